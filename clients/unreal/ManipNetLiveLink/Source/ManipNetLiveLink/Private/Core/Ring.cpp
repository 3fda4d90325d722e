#include "Ring.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace manipnet {

Ring::Ring() {
    for (auto& frame : Frames) frame = std::make_unique<HandsFrame>();
}

void Ring::Exchange(std::int64_t grid, std::unique_ptr<HandsFrame>& frame) {
    const std::size_t slot = Slot(grid);
    std::swap(Frames[slot], frame);
    if (Empty) {
        Grid.fill(std::numeric_limits<std::int64_t>::min());
        First = Last = grid;
        Empty = false;
    }
    Grid[slot] = grid;
    Last = std::max(Last, grid);
    while (!IsPresent(First)) ++First;
}

std::size_t Ring::Weigh(double position) {
    Weights.fill(0.0);
    position = std::min(std::max(position, static_cast<double>(First)), static_cast<double>(Last));
    if (First == Last) {
        Weights[Slot(Last)] = 1.0;
        return Slot(Last);
    }
    const std::int64_t start = std::min(static_cast<std::int64_t>(std::floor(position)), Last - 1);
    const double f = position - static_cast<double>(start);
    const double g = 1.0 - f;
    Add(start - 1, g * g * g / 6.0);
    Add(start, (3.0 * f * f * f - 6.0 * f * f + 4.0) / 6.0);
    Add(start + 1, (-3.0 * f * f * f + 3.0 * f * f + 3.0 * f + 1.0) / 6.0);
    Add(start + 2, f * f * f / 6.0);
    return Nearest(position);
}

std::size_t Ring::Nearest(double position) const {
    std::size_t nearest = Slot(Last);
    double least = std::numeric_limits<double>::infinity();
    for (std::int64_t i = First; i <= Last; ++i) {
        const double distance = std::abs(static_cast<double>(i) - position);
        if (!IsPresent(i) || distance >= least) continue;
        least = distance;
        nearest = Slot(i);
    }
    return nearest;
}

void Ring::Add(std::int64_t index, double weight) {
    if (IsPresent(index)) {
        Weights[Slot(index)] += weight;
    } else if (index > Last) {
        Add(Last, 2.0 * weight);
        Add(Last - 1, -weight);
    } else if (index < First) {
        Add(First, 2.0 * weight);
        Add(First + 1, -weight);
    } else {
        Fill(index, weight);
    }
}

/// Adds a lost frame by the polynomial through up to two frames on each side of it.
void Ring::Fill(std::int64_t index, double weight) {
    const std::size_t count = Collect(index, 1, Collect(index, -1, 0));
    for (std::size_t i = 0; i < count; ++i) {
        double part = weight;
        for (std::size_t j = 0; j < count; ++j)
            if (j != i) part *= static_cast<double>(index - Nodes[j]) / static_cast<double>(Nodes[i] - Nodes[j]);
        Weights[Slot(Nodes[i])] += part;
    }
}

std::size_t Ring::Collect(std::int64_t index, std::int64_t step, std::size_t count) {
    const std::size_t limit = count + 2;
    for (std::int64_t i = index + step; i >= First && i <= Last && count < limit; i += step)
        if (IsPresent(i)) Nodes[count++] = i;
    return count;
}

bool Ring::IsPresent(std::int64_t index) const {
    return index >= First && index <= Last && index > Last - kSize && Grid[Slot(index)] == index;
}

}  // namespace manipnet
