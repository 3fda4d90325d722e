#pragma once

#include <cstdint>
#include <string>

namespace manipnet {

/// What a connection string says: "tcp://HOST:PORT", then optionally " actor=NAME" and " delay=SECONDS".
struct Connection {
    std::string Host = "127.0.0.1";
    std::uint16_t Port = 5555;
    std::string Actor;  ///< Empty: the first seen.
    double DelayS = 0.1;

    static constexpr const char* kDefault = "tcp://127.0.0.1:5555";
    static constexpr double kMaxDelayS = 1.0;
};

/// Returns what is wrong with the text and what is allowed, or an empty text. An empty `text` means the default.
std::string ParseConnection(const std::string& text, Connection& connection);

}  // namespace manipnet
