#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "HandsFrame.h"

namespace manipnet {

/// The last frames on the 60 Hz grid of their capture times, and how much of each makes up an instant between them: a
/// uniform cubic B-spline, whose acceleration never exceeds the frames' own second differences. Lost frames are filled
/// from two neighbours on each side; beyond the ends it goes straight on.
class Ring {
public:
    static constexpr std::int64_t kSize = 32;
    using Slots = std::array<std::unique_ptr<HandsFrame>, kSize>;

    Ring();
    void Clear() { Empty = true; }

    /// Put a frame in its place and get another one, free to be overwritten.
    void Exchange(std::int64_t grid, std::unique_ptr<HandsFrame>& frame);

    /// Set Weights for a position on the grid; returns the slot of the nearest frame.
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
