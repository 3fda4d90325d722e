#pragma once

#include <array>
#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "Connection.h"
#include "Interpolator.h"
#include "ZmtpSubscriber.h"

namespace manipnet {

/// What a status line shows.
struct Stats {
    std::string State = "connecting";
    std::int64_t Received = 0;  ///< Frames that arrived; Late ones of these came too late to be shown.
    std::int64_t Late = 0;
    std::int64_t Lost = 0;     ///< Frames that never arrived.
    std::int64_t Refused = 0;  ///< Messages that could not be read.
    int Connections = 0;
    std::uint64_t Seq = 0;  ///< Number of the newest frame, as the server counts them.
    double RateHz = 0.0;
    double AgeS = -1.0;     ///< Seconds since the newest frame; negative before the first.
    double TransitS = 0.0;  ///< Seconds it was on its way; means something only where server and client share a clock.
};

/// Receives the hands of one actor (the first seen, unless named) on its own thread; reconnects by itself. All methods
/// may be called from any thread; none waits for the network except the destructor, which waits for the thread.
class Client {
public:
    explicit Client(const Connection& to);
    ~Client();
    Client(const Client&) = delete;
    Client& operator=(const Client&) = delete;

    /// What to show at the time `now` of LocalNow; see Interpolator::Sample.
    bool Sample(double now, HandsFrame& output, float& weight);
    Stats GetStats() const;

private:
    void Run();
    std::string Read();
    void Take(double arrival);
    bool IsOurActor() const;
    void SetState(const std::string& state);

    const Connection To;
    mutable std::mutex Lock;
    std::condition_variable Wake;
    std::atomic<bool> Stopping{false};
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
