#include "Client.h"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <utility>

#include "Decoder.h"
#include "LocalClock.h"

namespace manipnet {
namespace {

constexpr int kBackOffMs = 100;
constexpr int kBackOffLimitMs = 1000;

}  // namespace

Client::Client(const Connection& to, OnFrame arrived, const std::string& topic)
    : To(to), Arrived(std::move(arrived)), Topic(topic), Subscriber(layout::kMaxPayloadBytes, Stopping) {
    Frames.DelayS = to.DelayS;
    Thread = std::thread([this] { Run(); });
}

Client::~Client() {
    Client::Stop();
    Thread.join();
}

void Client::Stop() {
    {
        const std::lock_guard<std::mutex> guard(Lock);
        Stopping = true;
    }
    Wake.notify_all();
}

bool Client::Sample(double now, HandsFrame& output, float& weight) {
    const std::lock_guard<std::mutex> guard(Lock);
    return Frames.Sample(now, output, weight);
}

void Client::SetDelay(double delayS) {
    const std::lock_guard<std::mutex> guard(Lock);
    Frames.DelayS = delayS;
}

Stats Client::GetStats() const {
    const std::lock_guard<std::mutex> guard(Lock);
    Stats stats = Counted;
    const double now = LocalNow();
    stats.Late = Frames.Late;
    stats.Seq = Seq;
    stats.AgeS = stats.Received > 0 ? now - NewestAt : -1.0;
    const auto known = std::min<std::size_t>(static_cast<std::size_t>(stats.Received), Arrivals.size());
    double earliest = now;
    double latest = 0.0;
    int recent = 0;
    for (std::size_t i = 0; i < known; ++i) {
        if (now - Arrivals[i] > 1.0) continue;
        ++recent;
        earliest = std::min(earliest, Arrivals[i]);
        latest = std::max(latest, Arrivals[i]);
    }
    stats.RateHz = recent > 1 ? (recent - 1) / (latest - earliest) : 0.0;
    return stats;
}

void Client::Run() {
    int wait = kBackOffMs;
    while (!Stopping) {
        const std::int64_t before = Counted.Received;
        const std::string error = Read();
        Subscriber.Close();
        SetState("reconnecting: " + error);
        wait = Counted.Received > before ? kBackOffMs : std::min(2 * wait, kBackOffLimitMs);
        std::unique_lock<std::mutex> guard(Lock);
        Wake.wait_for(guard, std::chrono::milliseconds(wait), [this] { return Stopping.load(); });
    }
    SetState("closed");
    Stopped = true;
}

/// Reads until the connection breaks, and returns the reason.
std::string Client::Read() {
    const std::string error = Subscriber.Open(To.Host, To.Port, Topic);
    if (!error.empty()) return error;
    {
        const std::lock_guard<std::mutex> guard(Lock);
        ++Counted.Connections;
    }
    SetState("connected");
    while (!Stopping) {
        const ZmtpSubscriber::Next next = Subscriber.NextMessage();
        if (next == ZmtpSubscriber::Next::Broken) return Subscriber.Error();
        if (next == ZmtpSubscriber::Next::Message) Take(LocalNow());
    }
    return {};
}

void Client::Take(double arrival) {
    const std::size_t topic = Topic.size();
    const std::uint8_t* message = Subscriber.Message();
    const std::size_t length = Subscriber.MessageLength();
    if (length < topic || std::memcmp(message, Topic.data(), topic) != 0) return;
    const std::string error = Decode(message + topic, length - topic, *Spare);
    if (!error.empty()) {
        SetState("message refused: " + error);
        const std::lock_guard<std::mutex> guard(Lock);
        ++Counted.Refused;
        return;
    }
    if (!IsOurActor()) return;
    if (Arrived) Arrived(*Spare);  // outside of the lock, because it may wait for a lock of its own
    const std::lock_guard<std::mutex> guard(Lock);
    Count(arrival);
    if (Frames.Push(Spare, arrival)) NewestAt = arrival;
    if (Counted.State != "connected") Counted.State = "connected";
}

void Client::Count(double arrival) {
    Actor = Spare->Actor;
    const bool same = Counted.Received > 0 && Spare->Session == Session;
    if (same && Spare->Seq > Seq + 1) Counted.Lost += static_cast<std::int64_t>(Spare->Seq - Seq - 1);
    Session = Spare->Session;
    Seq = Spare->Seq;
    Arrivals[static_cast<std::size_t>(Counted.Received++) % Arrivals.size()] = arrival;
    Counted.TransitS = arrival - Spare->TPublish;
}

/// Only the client's thread writes what this reads.
bool Client::IsOurActor() const {
    if (!To.Actor.empty()) return To.Actor == Spare->Actor.Text;
    return Counted.Received == 0 || Spare->Actor == Actor;
}

void Client::SetState(const std::string& state) {
    const std::lock_guard<std::mutex> guard(Lock);
    Counted.State = state;
}

}  // namespace manipnet
