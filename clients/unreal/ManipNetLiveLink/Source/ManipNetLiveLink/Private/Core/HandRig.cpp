#include "HandRig.h"

#include "Axes.h"
#include "RestJoints.h"

namespace manipnet {
namespace {

constexpr std::size_t kTipFromDistal = 1;

/// The pose of a joint at rest, relative to the wrist. The stored hand is a right one; a left one is its mirror image.
UnrealPose RestJoint(Side side, std::size_t joint) {
    std::array<float, 7> pose{};
    for (std::size_t i = 0; i < pose.size(); ++i) pose[i] = kRestJoints[joint][i];
    if (side == Side::Left)
        for (const std::size_t mirrored : {0U, 4U, 5U}) pose[mirrored] = -pose[mirrored];
    return ToUnreal(pose.data());
}

Vec RestPosition(Side side, std::size_t joint) { return PositionOf(RestJoint(side, joint)); }

/// The rotation of a frame with x along `along` and y towards `across`.
Quat Frame(const Vec& along, const Vec& across) {
    const Quat first = FromTo({1.0, 0.0, 0.0}, along);
    const Vec unit = Unit(along);
    const Vec local = Rotate(Inverse(first), across - Dot(across, unit) * unit);
    const double half = 0.5 * std::atan2(local.Z, local.Y);
    return first * Quat{std::sin(half), 0.0, 0.0, std::cos(half)};
}

struct Bones {
    std::size_t Along, First, Last;
};

/// The first bones of the fingers that give a hand its orientation: of the middle, index and little finger where they
/// exist. Returns false if there is no pair of fingers.
bool ChooseBones(const RestHand& rest, Bones& chosen) {
    constexpr std::array<std::size_t, 4> kMiddleFirst{6, 3, 9, 12};
    chosen.Along = kFingerBones;
    for (const std::size_t bone : kMiddleFirst)
        if (chosen.Along == kFingerBones && rest.HasBone[bone]) chosen.Along = bone;
    if (chosen.Along == kFingerBones) chosen.Along = 0;
    chosen.First = chosen.Last = kFingerBones;
    for (std::size_t bone = 3; bone < kFingerBones; bone += 3) {
        if (!rest.HasBone[bone]) continue;
        if (chosen.First == kFingerBones) chosen.First = bone;
        chosen.Last = bone;
    }
    if (chosen.First == chosen.Last && rest.HasBone[0]) chosen.First = 0;
    return chosen.First != chosen.Last && chosen.Last != kFingerBones;
}

/// The rotation from the frame of our wrist to that of the character's hand bone.
Quat AlignHands(Side side, const RestHand& rest) {
    Bones bones{};
    const bool pair = ChooseBones(rest, bones);
    const auto ours = [side](std::size_t bone) { return RestPosition(side, JointOfBone(bone)); };
    if (!pair) return FromTo(ours(bones.Along), rest.Positions[bones.Along]);
    const Vec theirs = rest.Positions[bones.First] - rest.Positions[bones.Last];
    return Frame(rest.Positions[bones.Along], theirs) * Inverse(Frame(ours(bones.Along), ours(bones.First) - ours(bones.Last)));
}

/// Where a bone of the character points, and where ours does, in the spaces of their hands.
void Directions(Side side, const RestHand& rest, std::size_t bone, Vec& theirs, Vec& ours) {
    const std::size_t finger = bone / 3;
    const std::size_t last = 3 * finger + 2;
    const Vec start = RestPosition(side, JointOfBone(bone));
    std::size_t next = bone + 1;
    while (next <= last && !rest.HasBone[next]) ++next;
    if (next <= last) {
        theirs = rest.Positions[next] - rest.Positions[bone];
        ours = RestPosition(side, JointOfBone(next)) - start;
        return;
    }
    ours = RestPosition(side, JointOfBone(bone) + kTipFromDistal) - start;
    if (rest.HasTip[finger]) {
        theirs = rest.Tips[finger] - rest.Positions[bone];
        return;
    }
    std::size_t before = bone;
    while (before > 3 * finger && (before == bone || !rest.HasBone[before])) --before;
    const bool known = before != bone && rest.HasBone[before];
    theirs = known ? rest.Positions[bone] - rest.Positions[before] : rest.Positions[bone];
}

}  // namespace

std::size_t JointOfBone(std::size_t bone) {
    const std::size_t finger = bone / 3;
    const std::size_t part = bone % 3;
    return finger == 0 ? 2 + part : 2 + 5 * finger + part;
}

HandRig::HandRig(Side side, const RestHand& rest) : WristToHand(AlignHands(side, rest)) {
    for (std::size_t bone = 0; bone < kFingerBones; ++bone) {
        if (!rest.HasBone[bone]) continue;
        Vec theirs, ours;
        Directions(side, rest, bone, theirs, ours);
        const Quat turn = FromTo(theirs, Rotate(WristToHand, ours));
        const Quat zero = RotationOf(RestJoint(side, JointOfBone(bone)));
        Bind[bone] = Inverse(zero) * Inverse(WristToHand) * turn * rest.Rotations[bone];
    }
}

std::array<Quat, kFingerBones> HandRig::Solve(const HandPose& hand) const {
    std::array<Quat, kFingerBones> turned;
    for (std::size_t bone = 0; bone < kFingerBones; ++bone)
        turned[bone] = Normalized(WristToHand * hand.Fingers[bone] * Bind[bone]);
    return turned;
}

}  // namespace manipnet
