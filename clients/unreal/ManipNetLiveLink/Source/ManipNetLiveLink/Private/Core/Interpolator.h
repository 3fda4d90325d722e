#pragma once

#include <cstdint>
#include <limits>
#include <memory>

#include "HandsFrame.h"
#include "Mixer.h"
#include "Ring.h"
#include "SmoothClock.h"

namespace manipnet {

/// Interpolates hands by capture time, a chosen delay behind, for any display rate; holds and then fades them on loss.
/// Not thread-safe. Allocates nothing after construction.
class Interpolator {
public:
    double DelayS = 0.1;
    std::int64_t Late = 0;  ///< The number of frames that came too late to be shown.

    /// Takes a frame that arrived at the local time `arrival` and gives one to fill next. Returns false if it is too
    /// late.
    bool Push(std::unique_ptr<HandsFrame>& frame, double arrival);

    /// Computes the hands to show at the local time `now`, which must not decrease. Returns false before the first
    /// frame. `weight` falls from 1 to 0 when the stream is lost; use it to blend to another animation.
    bool Sample(double now, HandsFrame& output, float& weight);

private:
    bool Accept(const HandsFrame& frame, double arrival);
    void Restart(const HandsFrame& frame);
    bool IsStale(const HandsFrame& frame, double arrival);
    void Ease(HandsFrame& output, double starved, double now);
    std::int64_t GridOf(double capture) const;

    Ring Recent;
    SmoothClock Clock;
    Name Session;
    HandsFrame Shown;
    HandsFrame Held;
    HandsFrame Target;
    bool HasNewest = false;
    bool HasShown = false;
    bool Starved = false;
    bool Blending = false;
    std::uint64_t Seq = 0;
    double Capture = 0.0;
    double T0 = 0.0;
    double Now = 0.0;
    double Resumed = 0.0;
    double Weight = 0.0;
    double StaleSince = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace manipnet
