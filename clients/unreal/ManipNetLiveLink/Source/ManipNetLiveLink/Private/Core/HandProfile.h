#pragma once

#include <array>
#include <string>

#include "HandRig.h"

namespace manipnet {

/// One hand of a hand profile (docs/any-hand.md), made from the bones of a character: its OpenXR joints at rest with
/// straight fingers, in the frame of its wrist joint. It computes what `manipnet hand import` does for a rig without a skin.
struct HandProfile {
    using Joint = std::array<double, 7>;

    std::array<bool, layout::kJointCount> HasJoint{};
    std::array<Joint, layout::kJointCount> Joints{};  ///< Position in metres and quaternion, in the project's axes.
    Quat ToHand;                                      ///< From the frame of the wrist joint to the hand bone, in Unreal's axes.
    std::array<Vec, kFingerBones> Ends{};             ///< Of the bones at rest, in the space of the hand bone, in Unreal's axes.

    /// The rotation of a joint in the frame of the wrist joint, in Unreal's axes.
    Quat Rotation(std::size_t joint) const;
};

/// Makes the profile of a hand. Returns an empty string, or why the bones are not those of a hand and what to do.
std::string MakeProfile(Side side, const RestHand& rest, HandProfile& profile);

/// A rig that puts every joint of the character where a message says whose hand was solved on this profile.
HandRig ExactRig(const RestHand& rest, const HandProfile& profile);

/// Both hands as the request `hand_profile` wants them. A hand that is null is left out.
std::string ProfileJson(const std::string& name, const HandProfile* left, const HandProfile* right);

/// A name that may be part of a topic: that of the character, and four digits that differ for other hands and other actors,
/// so that two characters of one name do not replace each other's profiles.
std::string ProfileName(const std::string& character, const std::string& actor, const HandProfile* left, const HandProfile* right);

}  // namespace manipnet
