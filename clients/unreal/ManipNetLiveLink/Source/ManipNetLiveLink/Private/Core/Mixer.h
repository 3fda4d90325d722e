#pragma once

#include <array>
#include <cstddef>

#include "Ring.h"

namespace manipnet {

/// A frame and its weight.
struct Part {
    const HandsFrame* Frame = nullptr;
    double Weight = 0.0;
};

/// The weighted frames of a mean, at most as many as a ring holds.
struct Parts {
    std::array<Part, Ring::kSize> Items{};
    std::size_t Count = 0;

    void Add(const HandsFrame& frame, double weight) {
        if (weight != 0.0) Items[Count++] = {&frame, weight};
    }
    const Part* begin() const { return Items.data(); }
    const Part* end() const { return Items.data() + Count; }
};

/// Computes the weighted mean of frames; quaternions are summed and normalised. Names, states and the like come from
/// `reference`. Allocates nothing.
void Mix(const Parts& parts, const HandsFrame& reference, HandsFrame& output);

}  // namespace manipnet
