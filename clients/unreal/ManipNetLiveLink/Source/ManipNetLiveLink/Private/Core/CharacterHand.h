#pragma once

#include <string>
#include <vector>

#include "BoneNames.h"
#include "HandProfile.h"
#include "HandRig.h"

namespace manipnet {

/// The skeleton of a character in its rest pose; a parent comes before its children.
struct RestSkeleton {
    std::vector<std::string> Names;
    std::vector<int> Parents;
    std::vector<LocalBone> Local;
};

/// The pose of a character that is being built. A level of detail may lack bones of the skeleton.
class CharacterPose {
public:
    virtual ~CharacterPose() = default;
    virtual bool Has(int bone) const = 0;
    virtual LocalBone Get(int bone) const = 0;
    virtual void SetRotation(int bone, const Quat& rotation) = 0;
};

/// Puts one hand on a character: it finds the bones, and changes nothing but rotations.
class CharacterHand {
public:
    /// Finds the bones of the hand. Returns an empty string, or which bones are missing; fingers that exist are driven
    /// nevertheless, if there is a hand.
    std::string Bind(const RestSkeleton& skeleton, Side side, const BoneMap& map);

    /// As Bind, for hands that the server has solved on this character: every joint then is where the message says.
    std::string BindExactly(const RestSkeleton& skeleton, Side side, const BoneMap& map);

    /// Makes the profile of the hand. Returns an empty string, or why there is none.
    std::string Profile(const RestSkeleton& skeleton, Side side, const BoneMap& map, HandProfile& profile);

    bool IsBound() const { return Bones.Hand >= 0 && AnyFinger; }

    /// Turns the fingers, and with `moveWrist` also the hand and the arm, so that the hand arrives at the tracked wrist,
    /// which is given in the space of the character. `weight` blends from the pose that the character has.
    void Apply(const HandPose& hand, bool moveWrist, double weight, CharacterPose& pose) const;

private:
    LocalBone InSpaceOf(int ancestor, int bone, const CharacterPose& pose) const;
    void SetInCharacter(int bone, const Quat& rotation, CharacterPose& pose) const;
    void MoveWrist(const HandPose& hand, double weight, CharacterPose& pose) const;
    void TurnFingers(const HandPose& hand, double weight, CharacterPose& pose) const;
    RestHand RestOf(const RestSkeleton& skeleton, double scale) const;

    BoneIndices Bones;
    bool AnyFinger = false;
    HandRig Rig;
    std::vector<int> Parents;
};

}  // namespace manipnet
