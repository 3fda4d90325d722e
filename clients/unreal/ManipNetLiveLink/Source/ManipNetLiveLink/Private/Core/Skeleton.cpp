#include "Skeleton.h"

namespace manipnet {
namespace {

/// The order of joints, because Live Link needs parents before children and OpenXR has the palm before the wrist.
std::size_t JointOf(std::size_t bone) { return bone < 2 ? 1 - bone : bone; }

UnrealPose Relative(const UnrealPose& parent, const UnrealPose& child) {
    const Quat back = Inverse(RotationOf(parent));
    return PoseOf(Rotate(back, PositionOf(child) - PositionOf(parent)), back * RotationOf(child));
}

}  // namespace

const char* Skeleton::BoneName(std::size_t bone) { return layout::kJointNames[JointOf(bone)]; }

int Skeleton::ParentOf(std::size_t bone) {
    const int parent = layout::kJointParents[JointOf(bone)];
    return parent < 0 ? -1 : static_cast<int>(JointOf(static_cast<std::size_t>(parent)));
}

void Skeleton::LocalPoses(const HandFrame& hand, const Placement& placement, Poses& output) {
    Poses world;
    for (std::size_t bone = 0; bone < kBones; ++bone) {
        world[bone] = placement.Place(ToUnreal(&hand.Joints[7 * JointOf(bone)]));
        const int parent = ParentOf(bone);
        output[bone] = parent < 0 ? world[bone] : Relative(world[static_cast<std::size_t>(parent)], world[bone]);
    }
}

}  // namespace manipnet
