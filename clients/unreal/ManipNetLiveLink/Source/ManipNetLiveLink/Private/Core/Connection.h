#pragma once

#include <cstdint>
#include <string>

#include "Placement.h"

namespace manipnet {

/// How frames reach Live Link: interpolated for each engine tick, or as they arrive with their capture times.
enum class Mode { Smooth, Raw };

/// The parts of a connection string: "tcp://HOST:PORT", then optionally " actor=NAME", " delay=SECONDS", " mode=raw",
/// " yaw=DEGREES", " origin=X,Y,Z" and " scale=FACTOR". A name with spaces stands in double quotes.
struct Connection {
    std::string Host = "127.0.0.1";
    std::uint16_t Port = 5555;
    std::string Actor;  ///< Empty for the first one received.
    double DelayS = 0.1;
    Mode Delivery = Mode::Smooth;
    Placement Place;

    static constexpr const char* kDefault = "tcp://127.0.0.1:5555";
    static constexpr double kMaxDelayS = 1.0;
    static constexpr double kMinScale = 0.001;
    static constexpr double kMaxScale = 1000.0;

    /// Whether both read the same stream; delay, mode and placement may differ.
    bool SameStream(const Connection& other) const {
        return Host == other.Host && Port == other.Port && Actor == other.Actor;
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
