#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "HandRig.h"

namespace manipnet {

/// The bones of a skeleton that a hand needs, as indices of its names, -1 for a bone that it lacks.
struct BoneIndices {
    int Hand = -1;
    int LowerArm = -1;
    int UpperArm = -1;
    std::array<int, kFingerBones> Fingers{};
    std::array<int, kFingers> Metacarpals{};  ///< The bones in the palm, by finger; the thumb has none.
};

/// A map made by hand: for the name of a bone in any known scheme, as in "LeftHandIndex1", that of the skeleton's bone.
using BoneMap = std::map<std::string, std::string>;

/// Reads a bone map in JSON: {"LeftHandIndex1": "a bone of the skeleton", ...}. Returns an empty string, or what is wrong
/// and what is allowed.
std::string ParseBoneMap(const std::string& json, BoneMap& map);

/// Finds the bones of a hand by the names in clients/README.md, and before them those of the map. `parents` holds the
/// index of each bone's parent, -1 for a root. The arm is that which the hand hangs on. All names together decide what one
/// cannot: whether a thumb is counted from its metacarpal or from zero, and which prefix they share, as Motive's do.
BoneIndices FindBones(const std::vector<std::string>& names, const std::vector<int>& parents, Side side, const BoneMap& map);

/// Whether the name `bone` means this bone of a finger, both counted from zero. A rig with a `thumbMetacarpal` (VRM 1,
/// Godot) calls the second bone of the thumb proximal.
bool MatchesFinger(const std::string& bone, Side side, std::size_t finger, std::size_t part, bool thumbMetacarpal);

/// Whether the name `bone` means the first bone of a thumb, as in VRM 1 and Godot.
bool IsThumbMetacarpal(const std::string& bone, Side side);

/// Whether the name `bone` means a bone in the palm that leads to one of the four fingers.
bool IsMetacarpal(const std::string& bone, Side side);

/// Whether the name `bone` means the hand itself.
bool IsHandName(const std::string& bone, Side side);

}  // namespace manipnet
