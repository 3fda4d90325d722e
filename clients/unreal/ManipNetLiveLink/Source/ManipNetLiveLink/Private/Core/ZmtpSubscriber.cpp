#include "ZmtpSubscriber.h"

#include <algorithm>
#include <cstring>

#include "LocalClock.h"

namespace manipnet {
namespace {

constexpr int kMore = 1;
constexpr int kLong = 2;
constexpr int kCommand = 4;
constexpr int kHandshakeMs = 2000;
constexpr int kWaitMs = 250;
constexpr double kPingAfterS = 1.0;
constexpr double kDeadAfterS = 3.0;
constexpr std::size_t kGreetingBytes = 64;
constexpr std::size_t kSignatureBytes = 11;
constexpr std::size_t kMechanism = 12;
constexpr std::size_t kMechanismBytes = 20;

}  // namespace

ZmtpSubscriber::ZmtpSubscriber(std::size_t maxBytes, const std::atomic<bool>& stop)
    : Connection(stop), MaxBytes(maxBytes), Buffer(2 * (maxBytes + 16)) {}

std::string ZmtpSubscriber::Open(const std::string& host, std::uint16_t port, const std::string& topic) {
    Start = End = Resume = MessageSize = 0;
    InsideMessage = false;
    Failure.clear();
    Heard = Pinged = LocalNow();
    std::string error = Connection.Connect(host, port, kHandshakeMs);
    if (error.empty()) error = Handshake(topic);
    if (!error.empty()) Close();
    return error;
}

ZmtpSubscriber::Next ZmtpSubscriber::NextMessage() {
    while (NextFrame()) {
        if ((Flags & kCommand) != 0) {
            if (!Answer()) return Next::Broken;
            continue;
        }
        const bool complete = (Flags & kMore) == 0 && !InsideMessage;  // longer messages than ours are skipped
        InsideMessage = (Flags & kMore) != 0;
        if (complete) return Next::Message;
    }
    return Failure.empty() && Receive(kWaitMs) ? Next::Nothing : Next::Broken;
}

std::string ZmtpSubscriber::Handshake(const std::string& topic) {
    std::uint8_t greeting[kGreetingBytes] = {0xFF};
    greeting[9] = 0x7F;
    greeting[10] = 3;
    greeting[11] = 1;
    std::memcpy(greeting + kMechanism, "NULL", 4);
    // Some servers that dislike the rest of the greeting close the connection without a reason, so it is sent later.
    std::string error = Connection.Send(greeting, kSignatureBytes);
    if (!error.empty()) return error;
    if (!FillUntil(kGreetingBytes)) return Failure;
    if (Buffer[0] != 0xFF || (Buffer[9] & 1) == 0 || Buffer[10] < 3) return "the other side does not speak ZMTP 3";
    const auto* name = reinterpret_cast<const char*>(Buffer.data() + kMechanism);
    const std::string mechanism(name, std::find(name, name + kMechanismBytes, '\0'));
    if (mechanism != "NULL") {
        return "the server requires " + mechanism + ", which this client does not support; use a tunnel";
    }
    const bool byCommand = Buffer[11] >= 1;
    Resume = kGreetingBytes;
    error = Connection.Send(greeting + kSignatureBytes, kGreetingBytes - kSignatureBytes);
    if (!error.empty()) return error;
    static constexpr char kReady[] = "\x05READY\x0bSocket-Type\0\0\0\x03SUB";
    if (!Send(kCommand, kReady, sizeof kReady - 1)) return Failure;
    while (!NextFrame())
        if (!Failure.empty() || !FillUntil(End - Start + 1)) return Failure;
    if ((Flags & kCommand) == 0 || !StartsWith("\x05READY", 6)) return "the server refused the connection";
    const std::string subscribe = (byCommand ? std::string("\x09SUBSCRIBE") : std::string("\x01")) + topic;
    return Send(byCommand ? kCommand : 0, subscribe.data(), subscribe.size()) ? std::string() : Failure;
}

/// Waits until the buffer has so many bytes.
bool ZmtpSubscriber::FillUntil(std::size_t count) {
    const double giveUp = LocalNow() + kHandshakeMs / 1000.0;
    while (End - Start < count) {
        if (LocalNow() > giveUp) return Fail("the other side does not speak ZMTP 3: it sends nothing");
        if (!Receive(kWaitMs)) return false;
    }
    return true;
}

bool ZmtpSubscriber::NextFrame() {
    Start = Resume;
    const std::size_t available = End - Start;
    if (available < 2) return false;
    Flags = Buffer[Start];
    const std::size_t head = (Flags & kLong) != 0 ? 9 : 2;
    if (available < head) return false;
    std::uint64_t size = 0;
    for (std::size_t i = 1; i < head; ++i) size = size << 8 | Buffer[Start + i];
    if (size > MaxBytes) {
        Fail("the server sent a frame that is longer than any message may be");
        return false;
    }
    if (available < head + size) return false;
    MessageStart = Start + head;
    MessageSize = static_cast<std::size_t>(size);
    Resume = MessageStart + MessageSize;
    return true;
}

bool ZmtpSubscriber::Receive(int timeoutMs) {
    if (Start > 0) {
        std::memmove(Buffer.data(), Buffer.data() + Start, End - Start);
        End -= Start;
        Start = Resume = 0;
    }
    const long got = Connection.Receive(Buffer.data() + End, Buffer.size() - End, timeoutMs);
    if (got < 0) return Fail("the server closed the connection");
    if (got == 0) return CheckAlive();
    End += static_cast<std::size_t>(got);
    Heard = LocalNow();
    return true;
}

bool ZmtpSubscriber::CheckAlive() {
    const double now = LocalNow();
    if (now - Heard > kDeadAfterS) return Fail("nothing has arrived for 3 s");
    if (now - Heard < kPingAfterS || now - Pinged < kPingAfterS) return true;
    Pinged = now;
    return Send(kCommand, "\x04PING\0\0", 7);
}

bool ZmtpSubscriber::Answer() {
    if (!StartsWith("\x04PING", 5)) return true;
    char pong[5 + 16] = {4, 'P', 'O', 'N', 'G'};
    const std::size_t context = MessageSize > 7 ? std::min<std::size_t>(MessageSize - 7, 16) : 0;
    std::memcpy(pong + 5, Message() + 7, context);
    return Send(kCommand, pong, 5 + context);
}

bool ZmtpSubscriber::Send(int flags, const char* body, std::size_t length) {
    std::uint8_t frame[2 + 255];
    frame[0] = static_cast<std::uint8_t>(flags);
    frame[1] = static_cast<std::uint8_t>(length);
    std::memcpy(frame + 2, body, length);
    const std::string error = Connection.Send(frame, 2 + length);
    return error.empty() || Fail(error.c_str());
}

bool ZmtpSubscriber::StartsWith(const char* text, std::size_t length) const {
    return MessageSize >= length && std::memcmp(Message(), text, length) == 0;
}

bool ZmtpSubscriber::Fail(const char* why) {
    Failure = why;
    return false;
}

}  // namespace manipnet
