#include "Interpolator.h"

#include <algorithm>
#include <cmath>

namespace manipnet {
namespace {

constexpr double kHoldS = 0.5;
constexpr double kFadeS = 0.5;
constexpr double kBlendS = 0.2;
constexpr double kStaleS = 0.25;
constexpr double kStaleLimitS = 0.5;
constexpr double kRateHz = layout::kRateHz;

double Smoothstep(double x) {
    x = std::min(std::max(x, 0.0), 1.0);
    return x * x * (3.0 - 2.0 * x);
}

}  // namespace

bool Interpolator::Push(std::unique_ptr<HandsFrame>& frame, double arrival) {
    if (!Accept(*frame, arrival)) {
        ++Late;
        return false;
    }
    Clock.Observe(arrival, frame->TCapture);
    Session = frame->Session;
    Seq = frame->Seq;
    Capture = frame->TCapture;
    HasNewest = true;
    Recent.Exchange(GridOf(Capture), frame);
    return true;
}

bool Interpolator::Sample(double now, HandsFrame& output, float& weight) {
    weight = 0.0F;
    if (!HasNewest) return false;
    const double position = (Clock.CaptureTime(now) - DelayS - T0) * kRateHz;
    const std::size_t nearest = Recent.Weigh(position);
    Parts parts;
    for (std::size_t i = 0; i < Recent.Frames.size(); ++i) parts.Add(*Recent.Frames[i], Recent.Weights[i]);
    Mix(parts, *Recent.Frames[nearest], output);
    Held.Bodies.reserve(output.BodyCount);  // the first gap must not allocate
    Target.Bodies.reserve(output.BodyCount);
    const double starved = (position - static_cast<double>(GridOf(Capture))) / kRateHz;
    Ease(output, starved, now);
    const double target = 1.0 - Smoothstep((starved - kHoldS) / kFadeS);
    Weight = HasShown ? std::min(target, Weight + (now - Now) / kFadeS) : target;
    weight = static_cast<float>(Weight);
    Shown.CopyFrom(output);
    HasShown = true;
    Now = now;
    return true;
}

bool Interpolator::Accept(const HandsFrame& frame, double arrival) {
    const bool same = HasNewest && frame.Session == Session;
    if (same && frame.Seq <= Seq) return false;
    if (!same || frame.TCapture < Capture - 0.5 / kRateHz) {
        Restart(frame);
    } else if (IsStale(frame, arrival)) {
        return false;
    } else if (frame.TCapture - Capture >= static_cast<double>(Ring::kSize) / kRateHz) {
        Recent.Clear();
    }
    return true;
}

/// Starts again, for a new session or after the sender's clock went back, as when a take loops.
void Interpolator::Restart(const HandsFrame& frame) {
    Recent.Clear();
    Clock.Reset();
    T0 = frame.TCapture;
    StaleSince = std::numeric_limits<double>::quiet_NaN();
    Starved = HasShown;
}

/// Whether the frame is backlog after a stall; if frames stay late for long, the clock has changed instead.
bool Interpolator::IsStale(const HandsFrame& frame, double arrival) {
    if (arrival - frame.TCapture - Clock.Target() <= kStaleS) {
        StaleSince = std::numeric_limits<double>::quiet_NaN();
        return false;
    }
    if (std::isnan(StaleSince)) StaleSince = arrival;
    if (arrival - StaleSince <= kStaleLimitS) return true;
    Restart(frame);
    return false;
}

/// Blends with the held pose for a short time after a gap.
void Interpolator::Ease(HandsFrame& output, double starved, double now) {
    if (starved > 1.0 / kRateHz) {
        Starved = true;
    } else if (Starved) {
        Starved = false;
        Blending = HasShown;
        Resumed = Now;
        Held.CopyFrom(Shown);
    }
    const double part = (now - Resumed) / kBlendS;
    Blending = Blending && part < 1.0;
    if (!Blending) return;
    Target.CopyFrom(output);
    Parts parts;
    parts.Add(Held, 1.0 - Smoothstep(part));
    parts.Add(Target, Smoothstep(part));
    Mix(parts, Target, output);
}

std::int64_t Interpolator::GridOf(double capture) const { return std::llround((capture - T0) * kRateHz); }

}  // namespace manipnet
