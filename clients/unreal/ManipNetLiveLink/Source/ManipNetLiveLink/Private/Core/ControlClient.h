#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "Socket.h"

namespace manipnet {

/// What became of a request: either `Reply` has the server's answer in JSON, or `Problem` says why there is none.
struct Answer {
    std::string Reply;
    std::string Problem;
    bool Refused = false;  ///< Whether `Problem` is the server's own text.
};

/// Sends requests to the server's control port, one connection for each: record, pause, select an object and the rest of
/// docs/protocol.md. A ZeroMQ requester on a plain TCP socket: ZMTP 3 with the NULL mechanism. It waits for the answer, so
/// call it on a thread of its own; `stop` ends the wait.
class ControlClient {
public:
    ControlClient(const std::string& host, std::uint16_t port, const std::atomic<bool>& stop, int timeoutMs = 10000);

    /// `request` is a JSON object with the field "op".
    Answer Ask(const std::string& request);

private:
    bool Exchange(const std::string& request, std::string& reply);
    bool Send(int flags, const std::string& body);
    bool Read(std::size_t count, std::string& into);
    bool ReadFrame(int& flags, std::string& body);
    bool Fail(const std::string& why);

    const std::string Host;
    const std::uint16_t Port;
    const std::atomic<bool>& Stop;
    const int TimeoutMs;
    Socket Link;
    double GiveUp = 0.0;
    std::string Failure;
};

}  // namespace manipnet
