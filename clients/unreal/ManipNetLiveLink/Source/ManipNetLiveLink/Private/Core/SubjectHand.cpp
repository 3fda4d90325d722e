#include "SubjectHand.h"

namespace manipnet {
namespace {

constexpr std::size_t kWrist = 1;
constexpr std::size_t kIndexProximal = 7;
constexpr std::size_t kLittleProximal = 22;

}  // namespace

bool SubjectHand::Bind(const std::vector<std::string>& names, const std::vector<int>& parents) {
    Parents = parents;
    Joints.assign(layout::kJointCount, -1);
    if (names.size() != parents.size()) return false;
    for (std::size_t joint = 0; joint < Joints.size(); ++joint)
        for (std::size_t bone = 0; bone < names.size(); ++bone)
            if (names[bone] == layout::kJointNames[joint]) Joints[joint] = static_cast<int>(bone);
    bool complete = Joints[kWrist] >= 0 && Joints[kLittleProximal] >= 0;
    for (std::size_t bone = 0; bone < kFingerBones; ++bone) complete = complete && Joints[JointOfBone(bone)] >= 0;
    return complete;
}

LocalBone SubjectHand::InWrist(std::size_t joint, const std::vector<LocalBone>& local) const {
    LocalBone at;
    for (int up = Joints[joint]; up >= 0 && up != Joints[kWrist]; up = Parents[static_cast<std::size_t>(up)])
        at = Then(local[static_cast<std::size_t>(up)], at);
    return at;
}

HandPose SubjectHand::Read(const std::vector<LocalBone>& local) const {
    LocalBone wrist;
    for (int up = Joints[kWrist]; up >= 0; up = Parents[static_cast<std::size_t>(up)])
        wrist = Then(local[static_cast<std::size_t>(up)], wrist);
    HandPose hand;
    hand.WristPosition = wrist.Translation;
    hand.WristRotation = wrist.Rotation;
    for (std::size_t bone = 0; bone < kFingerBones; ++bone)
        hand.Fingers[bone] = InWrist(JointOfBone(bone), local).Rotation;
    return hand;
}

Side SubjectHand::SideOf(const std::vector<LocalBone>& local) const {
    const Vec across = InWrist(kIndexProximal, local).Translation - InWrist(kLittleProximal, local).Translation;
    return across.Y > 0.0 ? Side::Right : Side::Left;
}

}  // namespace manipnet
