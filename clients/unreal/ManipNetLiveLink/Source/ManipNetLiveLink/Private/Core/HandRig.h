#pragma once

#include <array>
#include <cstddef>

#include "Geometry.h"
#include "HandsFrame.h"

namespace manipnet {

/// The finger bones of a hand: thumb to little finger, proximal to distal.
constexpr std::size_t kFingers = 5;
constexpr std::size_t kFingerBones = 15;

/// The finger bones of a character's hand in its rest pose, in the space of the hand bone and in Unreal's axes. A bone
/// that the character lacks is not present, and a tip that it lacks continues the last bone.
struct RestHand {
    std::array<bool, kFingerBones> HasBone{};
    std::array<Vec, kFingerBones> Positions{};
    std::array<Quat, kFingerBones> Rotations{};
    std::array<bool, kFingers> HasTip{};
    std::array<Vec, kFingers> Tips{};
    std::array<bool, kFingers> HasMetacarpal{};  ///< The bones in the palm, by finger; the thumb has none.
    std::array<Vec, kFingers> Metacarpals{};
};

/// The rotations of a synthesised hand, and its wrist in the world, in Unreal's axes.
struct HandPose {
    Vec WristPosition;
    Quat WristRotation;
    std::array<Quat, kFingerBones> Fingers{};  ///< OpenXR joints, relative to the wrist.
};

/// Makes the finger bones of any character point where the synthesised ones do, whatever their axes, lengths and rest
/// pose. This is the algorithm of the other clients (HandRig.cs and retarget.py), on OpenXR joints.
class HandRig {
public:
    HandRig() = default;
    HandRig(Side side, const RestHand& rest);
    HandRig(const Quat& wristToHand, const std::array<Quat, kFingerBones>& bind) : WristToHand(wristToHand), Bind(bind) {}

    /// The world rotation of the character's hand bone that follows the tracked wrist.
    Quat HandRotation(const HandPose& hand) const { return hand.WristRotation * Inverse(WristToHand); }

    /// The rotations of the finger bones in the space of the hand bone; only those of present bones have a meaning.
    std::array<Quat, kFingerBones> Solve(const HandPose& hand) const;

private:
    Quat WristToHand;
    std::array<Quat, kFingerBones> Bind{};
};

/// The joint that turns with a finger bone, as an index of layout::kJointNames. A rig's first bone of the thumb is
/// OpenXR's metacarpal; its first bone of another finger is OpenXR's proximal.
std::size_t JointOfBone(std::size_t bone);

}  // namespace manipnet
