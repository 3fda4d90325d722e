#include "CharacterHand.h"

#include "ArmIk.h"

namespace manipnet {
namespace {

constexpr const char* kFingerNames[] = {"thumb", "index", "middle", "ring", "little"};
constexpr const char* kPartNames[] = {"proximal", "intermediate", "distal"};

/// The names of the missing bones; a finger that is missing altogether is named once.
std::string Missing(const BoneIndices& bones) {
    std::string missing = bones.Hand < 0 ? "hand" : "";
    const auto add = [&missing](const std::string& what) { missing += (missing.empty() ? "" : ", ") + what; };
    for (std::size_t finger = 0; finger < kFingers; ++finger) {
        const std::size_t first = 3 * finger;
        if (bones.Fingers[first] < 0 && bones.Fingers[first + 1] < 0 && bones.Fingers[first + 2] < 0) {
            add(kFingerNames[finger]);
            continue;
        }
        for (std::size_t part = 0; part < 3; ++part)
            if (bones.Fingers[first + part] < 0) add(std::string(kFingerNames[finger]) + " " + kPartNames[part]);
    }
    return missing;
}

/// A bone whose child is nearer than this to it, relative to its distance from the hand, has no end there.
constexpr double kSamePlace = 0.006;

/// The scale of a bone in the space of the character.
double ScaleOf(const RestSkeleton& skeleton, int bone) {
    double scale = 1.0;
    for (int up = bone; up >= 0; up = skeleton.Parents[static_cast<std::size_t>(up)])
        scale *= skeleton.Local[static_cast<std::size_t>(up)].Scale;
    return scale;
}

/// Removes the bones that do not hang on the hand, as when a map names them wrongly.
void KeepDescendants(const std::vector<int>& parents, BoneIndices& bones) {
    const auto keep = [&](int& bone) {
        int above = bone;
        while (above >= 0 && above != bones.Hand) above = parents[static_cast<std::size_t>(above)];
        if (above < 0) bone = -1;
    };
    for (int& bone : bones.Fingers) keep(bone);
    for (int& bone : bones.Metacarpals) keep(bone);
}

}  // namespace

std::string CharacterHand::Bind(const RestSkeleton& skeleton, Side side, const BoneMap& map) {
    Parents = skeleton.Parents;
    Bones = FindBones(skeleton.Names, skeleton.Parents, side, map);
    KeepDescendants(Parents, Bones);
    AnyFinger = false;
    for (const int bone : Bones.Fingers) AnyFinger = AnyFinger || bone >= 0;
    if (IsBound()) Rig = HandRig(side, RestOf(skeleton, 1.0));
    const std::string missing = Missing(Bones);
    return missing.empty() ? missing : std::string(side == Side::Left ? "left" : "right") + " hand: no bone for " + missing;
}

std::string CharacterHand::Profile(const RestSkeleton& skeleton, Side side, const BoneMap& map, HandProfile& profile) {
    const std::string missing = Bind(skeleton, side, map);
    return IsBound() ? MakeProfile(side, RestOf(skeleton, ScaleOf(skeleton, Bones.Hand)), profile) : missing;
}

std::string CharacterHand::BindExactly(const RestSkeleton& skeleton, Side side, const BoneMap& map) {
    HandProfile profile;
    const std::string problem = Profile(skeleton, side, map, profile);
    if (problem.empty()) Rig = ExactRig(RestOf(skeleton, ScaleOf(skeleton, Bones.Hand)), profile);
    return problem;
}

/// The bones at rest in the space of the hand bone, in units that `scale` makes of the hand bone's own.
RestHand CharacterHand::RestOf(const RestSkeleton& skeleton, double scale) const {
    const auto inHand = [&](int bone) {
        LocalBone at = skeleton.Local[static_cast<std::size_t>(bone)];
        for (int up = Parents[static_cast<std::size_t>(bone)]; up != Bones.Hand; up = Parents[static_cast<std::size_t>(up)])
            at = Then(skeleton.Local[static_cast<std::size_t>(up)], at);
        at.Translation = scale * at.Translation;
        return at;
    };
    RestHand rest;
    for (std::size_t finger = 1; finger < kFingers; ++finger) {
        rest.HasMetacarpal[finger] = Bones.Metacarpals[finger] >= 0;
        if (rest.HasMetacarpal[finger]) rest.Metacarpals[finger] = inHand(Bones.Metacarpals[finger]).Translation;
    }
    for (std::size_t i = 0; i < kFingerBones; ++i) {
        if (Bones.Fingers[i] < 0) continue;
        const LocalBone at = inHand(Bones.Fingers[i]);
        rest.HasBone[i] = true;
        rest.Positions[i] = at.Translation;
        rest.Rotations[i] = at.Rotation;
        rest.HasTip[i / 3] = false;
        for (std::size_t child = 0; child < Parents.size(); ++child) {
            if (Parents[child] != Bones.Fingers[i]) continue;
            const Vec tip = inHand(static_cast<int>(child)).Translation;
            if (Length(tip - at.Translation) <= kSamePlace * Length(at.Translation)) continue;
            rest.HasTip[i / 3] = true;  // the child of the last bone that is present
            rest.Tips[i / 3] = tip;
            break;
        }
    }
    return rest;
}

void CharacterHand::Apply(const HandPose& hand, bool moveWrist, double weight, CharacterPose& pose) const {
    if (!IsBound() || weight <= 0.0 || !pose.Has(Bones.Hand)) return;
    if (moveWrist) MoveWrist(hand, weight, pose);
    TurnFingers(hand, weight, pose);
}

/// A bone in the space of an ancestor, -1 for that of the character.
LocalBone CharacterHand::InSpaceOf(int ancestor, int bone, const CharacterPose& pose) const {
    LocalBone at;
    for (int up = bone; up != ancestor && up >= 0; up = Parents[static_cast<std::size_t>(up)]) at = Then(pose.Get(up), at);
    return at;
}

void CharacterHand::SetInCharacter(int bone, const Quat& rotation, CharacterPose& pose) const {
    const LocalBone parent = InSpaceOf(-1, Parents[static_cast<std::size_t>(bone)], pose);
    pose.SetRotation(bone, Normalized(Inverse(parent.Rotation) * rotation));
}

void CharacterHand::MoveWrist(const HandPose& hand, double weight, CharacterPose& pose) const {
    const LocalBone now = InSpaceOf(-1, Bones.Hand, pose);
    const Quat turned = Blend(now.Rotation, Rig.HandRotation(hand), weight);
    if (Bones.LowerArm >= 0 && Bones.UpperArm >= 0) {
        const LocalBone upper = InSpaceOf(-1, Bones.UpperArm, pose);
        const LocalBone lower = InSpaceOf(-1, Bones.LowerArm, pose);
        const Vec target = now.Translation + weight * (hand.WristPosition - now.Translation);
        const ArmTurn arm = SolveArm(upper.Translation, lower.Translation, now.Translation, target);
        SetInCharacter(Bones.UpperArm, arm.Upper * upper.Rotation, pose);
        SetInCharacter(Bones.LowerArm, arm.Lower * lower.Rotation, pose);
    }
    SetInCharacter(Bones.Hand, turned, pose);
}

void CharacterHand::TurnFingers(const HandPose& hand, double weight, CharacterPose& pose) const {
    const std::array<Quat, kFingerBones> turned = Rig.Solve(hand);
    for (std::size_t i = 0; i < kFingerBones; ++i) {
        const int bone = Bones.Fingers[i];
        if (bone < 0 || !pose.Has(bone)) continue;
        const LocalBone parent = InSpaceOf(Bones.Hand, Parents[static_cast<std::size_t>(bone)], pose);
        pose.SetRotation(bone, Blend(pose.Get(bone).Rotation, Inverse(parent.Rotation) * turned[i], weight));
    }
}

}  // namespace manipnet
