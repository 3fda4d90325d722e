#include "ControlClient.h"

#include <algorithm>

#include "Json.h"
#include "LocalClock.h"

namespace manipnet {
namespace {

constexpr int kMore = 1;
constexpr int kLong = 2;
constexpr int kCommand = 4;
constexpr int kWaitMs = 250;
constexpr std::size_t kGreetingBytes = 64;
constexpr std::size_t kMechanism = 12;
constexpr std::size_t kMechanismBytes = 20;
constexpr std::uint64_t kMaxReplyBytes = 1U << 26;

/// The text of a refusal, {"error": "why"}, or an empty string for another reply.
std::string ReasonOf(const std::string& reply) {
    JsonReader reader(reply);
    std::string key, reason;
    const bool refused = reader.Take('{') && reader.TakeText(key) && key == "error" && reader.Take(':');
    return refused && reader.TakeText(reason) ? reason : std::string();
}

}  // namespace

ControlClient::ControlClient(const std::string& host, std::uint16_t port, const std::atomic<bool>& stop, int timeoutMs)
    : Host(host), Port(port), Stop(stop), TimeoutMs(timeoutMs), Link(stop) {}

Answer ControlClient::Ask(const std::string& request) {
    Answer answer;
    GiveUp = LocalNow() + TimeoutMs / 1000.0;
    Failure = Link.Connect(Host, Port, TimeoutMs);
    const bool answered = Failure.empty() && Exchange(request, answer.Reply);
    Link.Close();
    answer.Problem = answered ? ReasonOf(answer.Reply) : Failure;
    answer.Refused = answered && !answer.Problem.empty();
    if (!answer.Problem.empty()) answer.Reply.clear();
    return answer;
}

bool ControlClient::Exchange(const std::string& request, std::string& reply) {
    std::string greeting(kGreetingBytes, '\0');
    greeting[0] = static_cast<char>(0xFF);
    greeting[9] = 0x7F;
    greeting[10] = 3;
    greeting.replace(kMechanism, 4, "NULL");
    Failure = Link.Send(reinterpret_cast<const std::uint8_t*>(greeting.data()), greeting.size());
    std::string theirs;
    if (!Failure.empty() || !Read(kGreetingBytes, theirs)) return false;
    if (static_cast<unsigned char>(theirs[0]) != 0xFF || theirs[10] < 3) return Fail("the other side does not speak ZMTP 3");
    const std::string name = theirs.substr(kMechanism, kMechanismBytes);
    const std::string mechanism = name.substr(0, name.find('\0'));
    if (mechanism != "NULL") return Fail("the server requires " + mechanism + ", which this client does not support; use a tunnel");
    int flags = 0;
    std::string frame;
    if (!Send(kCommand, std::string("\x05READY\x0bSocket-Type\0\0\0\x03REQ", 25)) || !ReadFrame(flags, frame)) return false;
    // A request begins with an empty frame, and so does its reply.
    if (!Send(kMore, {}) || !Send(0, request)) return false;
    do {
        if (!ReadFrame(flags, reply)) return false;
    } while ((flags & (kCommand | kMore)) != 0);
    return true;
}

bool ControlClient::Send(int flags, const std::string& body) {
    const bool wide = body.size() > 255;
    std::string frame(1, static_cast<char>(flags | (wide ? kLong : 0)));
    for (int shift = wide ? 56 : 0; shift >= 0; shift -= 8)
        frame += static_cast<char>(static_cast<unsigned char>((static_cast<std::uint64_t>(body.size()) >> shift) & 0xFF));
    frame += body;
    Failure = Link.Send(reinterpret_cast<const std::uint8_t*>(frame.data()), frame.size());
    return Failure.empty();
}

bool ControlClient::Read(std::size_t count, std::string& into) {
    into.resize(count);
    for (std::size_t done = 0; done < count;) {
        const long got = Link.Receive(reinterpret_cast<std::uint8_t*>(&into[done]), count - done, kWaitMs);
        if (got < 0) return Fail("the server closed the connection");
        if (Stop) return Fail("the request was given up");
        if (got == 0 && LocalNow() > GiveUp) return Fail("the server has not answered in time");
        done += static_cast<std::size_t>(got);
    }
    return true;
}

bool ControlClient::ReadFrame(int& flags, std::string& body) {
    std::string head, size;
    if (!Read(1, head)) return false;
    flags = head[0];
    if (!Read((flags & kLong) != 0 ? 8 : 1, size)) return false;
    std::uint64_t bytes = 0;
    for (const char part : size) bytes = bytes << 8 | static_cast<unsigned char>(part);
    if (bytes > kMaxReplyBytes) return Fail("the server sent a frame that is longer than any reply may be");
    return Read(static_cast<std::size_t>(bytes), body);
}

bool ControlClient::Fail(const std::string& why) {
    Failure = why;
    return false;
}

}  // namespace manipnet
