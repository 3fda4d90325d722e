#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "HandsFrame.h"

namespace manipnet {

/// The last frames on the 60 Hz grid of their capture times, and the weights of frames that show an instant between
/// them. The weights are those of a uniform cubic B-spline, whose acceleration never exceeds the frames' second
/// differences. A lost frame is replaced by the cubic through two neighbours on each side, and beyond the ends the
/// first or last two frames are continued in a straight line.
class Ring {
public:
    static constexpr std::int64_t kSize = 32;
    using Slots = std::array<std::unique_ptr<HandsFrame>, kSize>;

    Ring();
    void Clear() { Empty = true; }

    /// Stores a frame and returns another one, which may be overwritten.
    void Exchange(std::int64_t grid, std::unique_ptr<HandsFrame>& frame);

    /// Sets Weights for a position on the grid and returns the slot of the nearest frame.
    std::size_t Weigh(double position);

    Slots Frames;
    std::array<double, kSize> Weights{};

private:
    static std::size_t Slot(std::int64_t grid) { return static_cast<std::size_t>(((grid % kSize) + kSize) % kSize); }
    bool IsPresent(std::int64_t index) const;
    std::size_t Nearest(double position) const;
    void Add(std::int64_t index, double weight);
    void Fill(std::int64_t index, double weight);
    std::size_t Collect(std::int64_t index, std::int64_t step, std::size_t count);

    std::array<std::int64_t, kSize> Grid{};
    std::array<std::int64_t, 4> Nodes{};
    std::int64_t First = 0;
    std::int64_t Last = 0;
    bool Empty = true;
};

}  // namespace manipnet
