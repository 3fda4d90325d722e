#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "Socket.h"

namespace manipnet {

/// A ZeroMQ subscriber on a plain TCP socket: ZMTP 3, NULL mechanism, one topic. After Open nothing is allocated unless
/// the connection breaks. For one thread.
class ZmtpSubscriber {
public:
    enum class Next { Message, Nothing, Broken };

    ZmtpSubscriber(std::size_t maxBytes, const std::atomic<bool>& stop);

    /// Connect and subscribe; returns what went wrong, or an empty text.
    std::string Open(const std::string& host, std::uint16_t port, const std::string& topic);
    void Close() { Connection.Close(); }

    /// Find the next whole message, waiting a quarter second for it. Broken: the connection is lost, or the other side is
    /// silent even to a ping, see Error.
    Next NextMessage();

    /// The message NextMessage found, until the next call.
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
    bool InParts = false;
    double Heard = 0.0;
    double Pinged = 0.0;
};

}  // namespace manipnet
