#pragma once

#include <array>
#include <cstddef>

#include "HandsFrame.h"
#include "Placement.h"

namespace manipnet {

/// A hand as a skeleton of OpenXR joints, each relative to its parent. The wrist comes first and is in the world.
struct Skeleton {
    static constexpr std::size_t kBones = layout::kJointCount;
    using Poses = std::array<UnrealPose, kBones>;

    static const char* BoneName(std::size_t bone);
    static int ParentOf(std::size_t bone);  ///< -1 for the wrist.
    static void LocalPoses(const HandFrame& hand, const Placement& placement, Poses& output);
};

}  // namespace manipnet
