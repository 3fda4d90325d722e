#pragma once

#include <array>
#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "Connection.h"
#include "Interpolator.h"
#include "ZmtpSubscriber.h"

namespace manipnet {

/// The state and the counters of a client.
struct Stats {
    std::string State = "connecting";
    std::int64_t Received = 0;  ///< Readable frames; Late are those of them that came too late to be shown.
    std::int64_t Late = 0;
    std::int64_t Lost = 0;     ///< Frames that never arrived.
    std::int64_t Refused = 0;  ///< Messages that could not be read.
    int Connections = 0;
    std::uint64_t Seq = 0;  ///< The server's number of the newest frame.
    double RateHz = 0.0;
    double AgeS = -1.0;     ///< Seconds since the newest frame arrived; negative before the first.
    double TransitS = 0.0;  ///< Seconds from its publication to its arrival, if server and client share a clock.
};

/// Receives the hands of one actor (the first one received, if none is named) on its own thread and reconnects by
/// itself. Any thread may call the methods, and none waits for the network except the destructor, which waits for the
/// thread.
class Client {
public:
    /// Calls `arrived`, if there is one, for every frame of the actor, on the client's thread.
    using OnFrame = std::function<void(const HandsFrame&)>;
    explicit Client(const Connection& to, OnFrame arrived = {}, const std::string& topic = layout::kTopic);
    virtual ~Client();
    Client(const Client&) = delete;
    Client& operator=(const Client&) = delete;

    /// Computes the hands to show at the time `now` of LocalNow; see Interpolator::Sample.
    bool Sample(double now, HandsFrame& output, float& weight);
    virtual Stats GetStats() const;
    void SetDelay(double delayS);

    /// Asks the thread to end, without waiting for it; HasStopped tells when the destructor no longer waits.
    virtual void Stop();
    virtual bool HasStopped() const { return Stopped; }

private:
    void Run();
    std::string Read();
    void Take(double arrival);
    void Count(double arrival);
    bool IsOurActor() const;
    void SetState(const std::string& state);

    const Connection To;
    const OnFrame Arrived;
    const std::string Topic;
    mutable std::mutex Lock;
    std::condition_variable Wake;
    std::atomic<bool> Stopping{false};
    std::atomic<bool> Stopped{false};
    ZmtpSubscriber Subscriber;
    Interpolator Frames;
    std::unique_ptr<HandsFrame> Spare = std::make_unique<HandsFrame>();
    Stats Counted;
    Name Session;
    Name Actor;
    std::uint64_t Seq = 0;
    double NewestAt = 0.0;
    std::array<double, layout::kRateHz> Arrivals{};
    std::thread Thread;
};

}  // namespace manipnet
