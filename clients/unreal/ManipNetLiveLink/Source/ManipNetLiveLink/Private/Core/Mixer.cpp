#include "Mixer.h"

#include <cmath>

namespace manipnet {
namespace {

/// `get(frame)` returns the array of a field of a frame; `output` holds the values of the reference.
template <typename Array, typename Get>
void MixNumbers(const Parts& parts, Get get, Array& output, std::size_t first, std::size_t stride, std::size_t width) {
    for (std::size_t i = first; i < output.size(); i += stride) {
        for (std::size_t j = i; j < i + width; ++j) {
            double sum = 0.0;
            for (const Part& part : parts) sum += part.Weight * get(*part.Frame)[j];
            output[j] = static_cast<float>(sum);
        }
    }
}

template <typename Array, typename Get>
void MixQuaternions(const Parts& parts, Get get, Array& output, std::size_t first, std::size_t stride) {
    for (std::size_t i = first; i < output.size(); i += stride) {
        std::array<double, 4> sum{};
        for (const Part& part : parts) {
            const Array& q = get(*part.Frame);
            double dot = 0.0;
            for (std::size_t c = 0; c < 4; ++c) dot += static_cast<double>(q[i + c]) * output[i + c];
            const double weight = dot < 0.0 ? -part.Weight : part.Weight;
            for (std::size_t c = 0; c < 4; ++c) sum[c] += weight * q[i + c];
        }
        const double length = std::sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2] + sum[3] * sum[3]);
        if (length < 1e-6) continue;
        for (std::size_t c = 0; c < 4; ++c) output[i + c] = static_cast<float>(sum[c] / length);
    }
}

template <typename Array, typename Get>
void MixPoses(const Parts& parts, Get get, Array& output) {
    MixNumbers(parts, get, output, 0, 7, 3);
    MixQuaternions(parts, get, output, 3, 7);
}

void MixHand(const Parts& parts, std::size_t side, HandFrame& output) {
    if (!output.Present) return;
    for (const Part& part : parts)
        if (!part.Frame->Hands[side].Present) return;  // it appears or disappears, so it is not in all
    using Frame = const HandsFrame&;
    MixNumbers(parts, [side](Frame f) -> auto& { return f.Hands[side].Angles; }, output.Angles, 0, 1, 1);
    MixQuaternions(parts, [side](Frame f) -> auto& { return f.Hands[side].Rotations; }, output.Rotations, 0, 4);
    MixPoses(parts, [side](Frame f) -> auto& { return f.Hands[side].Wrist; }, output.Wrist);
    MixPoses(parts, [side](Frame f) -> auto& { return f.Hands[side].Joints; }, output.Joints);
}

void MixBody(const Parts& parts, std::size_t index, BodyFrame& output) {
    for (const Part& part : parts)
        if (index >= part.Frame->BodyCount || part.Frame->Bodies[index].BodyName != output.BodyName) return;
    MixPoses(parts, [index](const HandsFrame& f) -> auto& { return f.Bodies[index].Pose; }, output.Pose);
}

}  // namespace

void Mix(const Parts& parts, const HandsFrame& reference, HandsFrame& output) {
    output.CopyFrom(reference);
    for (std::size_t side = 0; side < output.Hands.size(); ++side) MixHand(parts, side, output.Hands[side]);
    for (std::size_t i = 0; i < output.BodyCount; ++i) MixBody(parts, i, output.Bodies[i]);
}

}  // namespace manipnet
