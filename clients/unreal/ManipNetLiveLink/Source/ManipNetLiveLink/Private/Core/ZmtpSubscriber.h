#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "Socket.h"

namespace manipnet {

/// A ZeroMQ subscriber to one topic on a plain TCP socket: ZMTP 3 with the NULL mechanism. It allocates nothing after
/// Open unless the connection breaks. Only one thread may use it.
class ZmtpSubscriber {
public:
    enum class Next { Message, Nothing, Broken };

    ZmtpSubscriber(std::size_t maxBytes, const std::atomic<bool>& stop);

    /// Connects and subscribes; returns an empty string or the reason why it failed.
    std::string Open(const std::string& host, std::uint16_t port, const std::string& topic);
    void Close() { Connection.Close(); }

    /// Finds the next complete message and waits a quarter of a second for it. Returns Broken if the connection is lost
    /// or the other side does not even answer a ping; Error then gives the reason.
    Next NextMessage();

    /// The message that NextMessage found, valid until the next call.
    const std::uint8_t* Message() const { return Buffer.data() + MessageStart; }
    std::size_t MessageLength() const { return MessageSize; }
    const std::string& Error() const { return Failure; }

private:
    std::string Handshake(const std::string& topic);
    bool FillUntil(std::size_t count);
    bool NextFrame();
    bool Receive(int timeoutMs);
    bool CheckAlive();
    bool Answer();
    bool Send(int flags, const char* body, std::size_t length);
    bool StartsWith(const char* text, std::size_t length) const;
    bool Fail(const char* why);

    Socket Connection;
    std::size_t MaxBytes;
    std::vector<std::uint8_t> Buffer;
    std::string Failure;
    std::size_t Start = 0;
    std::size_t End = 0;
    std::size_t Resume = 0;
    std::size_t MessageStart = 0;
    std::size_t MessageSize = 0;
    int Flags = 0;
    bool InsideMessage = false;
    double Heard = 0.0;
    double Pinged = 0.0;
};

}  // namespace manipnet
