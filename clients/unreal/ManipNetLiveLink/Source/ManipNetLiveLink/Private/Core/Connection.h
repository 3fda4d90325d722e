#pragma once

#include <cstdint>
#include <string>

namespace manipnet {

/// The parts of a connection string: "tcp://HOST:PORT", then optionally " actor=NAME" and " delay=SECONDS".
struct Connection {
    std::string Host = "127.0.0.1";
    std::uint16_t Port = 5555;
    std::string Actor;  ///< Empty for the first one received.
    double DelayS = 0.1;

    static constexpr const char* kDefault = "tcp://127.0.0.1:5555";
    static constexpr double kMaxDelayS = 1.0;
};

/// Parses `text`, of which an empty one means the default. Returns an empty string, or what is wrong and what is
/// allowed.
std::string ParseConnection(const std::string& text, Connection& connection);

}  // namespace manipnet
