#pragma once

#include <array>
#include <cstddef>

#include "Ring.h"

namespace manipnet {

/// A frame and how much of it to take.
struct Part {
    const HandsFrame* Frame = nullptr;
    double Weight = 0.0;
};

/// The parts of a mixture: at most a ring full.
struct Parts {
    std::array<Part, Ring::kSize> Items{};
    std::size_t Count = 0;

    void Add(const HandsFrame& frame, double weight) {
        if (weight != 0.0) Items[Count++] = {&frame, weight};
    }
    const Part* begin() const { return Items.data(); }
    const Part* end() const { return Items.data() + Count; }
};

/// Weighted mean of frames: numbers linearly, quaternions by their normalised sum. Names, states and the like come from
/// `reference`. Allocates nothing.
void Mix(const Parts& parts, const HandsFrame& reference, HandsFrame& output);

}  // namespace manipnet
