#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>

namespace manipnet {

/// A TCP connection whose waits are short and end when `stop` is set. Functions that can fail return an empty string or
/// the reason.
class Socket {
public:
    explicit Socket(const std::atomic<bool>& stop) : Stop(stop) {}
    ~Socket() { Close(); }
    Socket(const Socket&) = delete;
    Socket& operator=(const Socket&) = delete;

    std::string Connect(const std::string& host, std::uint16_t port, int timeoutMs);
    void Close();
    std::string Send(const std::uint8_t* data, std::size_t length);

    /// Returns the number of bytes read into `data`, 0 if none came in time, -1 if the connection is lost.
    long Receive(std::uint8_t* data, std::size_t capacity, int timeoutMs);

private:
    bool Wait(bool toWrite, int timeoutMs) const;

    const std::atomic<bool>& Stop;
    std::intptr_t Handle = -1;
};

}  // namespace manipnet
