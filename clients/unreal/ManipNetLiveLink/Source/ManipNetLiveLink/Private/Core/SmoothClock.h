#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

namespace manipnet {

/// Estimates the sender's clock. The offset is a critically damped spring towards the smallest difference of arrival
/// and capture time in about the last second, so neither jitter nor a better estimate makes a step.
class SmoothClock {
public:
    void Reset() { Count = 0; }

    double Target() const {
        double least = std::numeric_limits<double>::infinity();
        for (std::size_t i = 0; i < std::min(Count, kWindow); ++i) least = std::min(least, Offsets[i]);
        return least;
    }

    void Observe(double arrival, double capture) {
        Offsets[Count % kWindow] = arrival - capture;
        if (Count == 0) {
            Offset = arrival - capture;
            Speed = 0.0;
            Last = arrival;
        }
        ++Count;
    }

    /// The sender's time at the local time `now`, which must not decrease between calls.
    double CaptureTime(double now) {
        const double step = std::max(now - Last, 0.0);
        Last = std::max(now, Last);
        const double target = Target();
        const double error = Offset - target;
        if (std::abs(error) > kSnapS) {
            Offset = target;
            Speed = 0.0;
            return now - Offset;
        }
        const double pull = Speed + kStiffnessHz * error;
        const double decay = std::exp(-kStiffnessHz * step);
        Offset = target + (error + pull * step) * decay;
        Speed = (Speed - kStiffnessHz * pull * step) * decay;
        return now - Offset;
    }

private:
    static constexpr std::size_t kWindow = 64;
    static constexpr double kStiffnessHz = 2.0;
    static constexpr double kSnapS = 0.25;
    std::array<double, kWindow> Offsets{};
    std::size_t Count = 0;
    double Offset = 0.0;
    double Speed = 0.0;
    double Last = 0.0;
};

}  // namespace manipnet
