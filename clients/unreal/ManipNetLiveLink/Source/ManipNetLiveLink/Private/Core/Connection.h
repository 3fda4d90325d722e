#pragma once

#include <cstdint>
#include <string>

#include "Placement.h"

namespace manipnet {

/// How frames reach Live Link: interpolated for each engine tick, or as they arrive with their capture times.
enum class Mode { Smooth, Raw };

/// The parts of a connection string: "tcp://HOST:PORT", then optionally " actor=NAME", " delay=SECONDS", " mode=raw",
/// " yaw=DEGREES", " origin=X,Y,Z", " scale=FACTOR", " control=PORT", " avatar=PATH" and " bones=MAP". A text with spaces
/// stands in double quotes; the map has its own double quotes and percent signs as %22 and %25.
struct Connection {
    std::string Host = "127.0.0.1";
    std::uint16_t Port = 5555;
    std::string Actor;  ///< Empty for the first one received.
    double DelayS = 0.1;
    Mode Delivery = Mode::Smooth;
    Placement Place;
    std::uint16_t ControlPort = 5557;  ///< Of the same host; only an avatar needs it.
    std::string Avatar;                ///< The path of the skeletal mesh on whose hands the server solves; empty for none.
    std::string AvatarBones;           ///< A bone map in JSON for bones of the avatar with unknown names.

    static constexpr const char* kDefault = "tcp://127.0.0.1:5555";
    static constexpr double kMaxDelayS = 1.0;
    static constexpr double kMinScale = 0.001;
    static constexpr double kMaxScale = 1000.0;

    /// Whether both read the same stream; delay, mode and placement may differ.
    bool SameStream(const Connection& other) const {
        return Host == other.Host && Port == other.Port && Actor == other.Actor && ControlPort == other.ControlPort &&
               Avatar == other.Avatar && AvatarBones == other.AvatarBones;
    }
};

/// Parses `text`, of which an empty one means the default. Returns an empty string, or what is wrong and what is
/// allowed.
std::string ParseConnection(const std::string& text, Connection& connection);

/// The shortest text that ParseConnection reads as `connection`.
std::string FormatConnection(const Connection& connection);

/// The address alone, as in "tcp://127.0.0.1:5555".
std::string FormatAddress(const Connection& connection);

}  // namespace manipnet
