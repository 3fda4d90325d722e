#include "HandProfile.h"

#include <algorithm>
#include <cstdio>
#include <vector>

#include "Axes.h"
#include "Json.h"
#include "PointAlignment.h"
#include "RestJoints.h"

namespace manipnet {
namespace {

constexpr double kMetacarpalBase = 0.3;
constexpr double kTipShare = 0.8;
constexpr double kThumbBehind = 0.08;
constexpr double kKnucklesOffM = 0.05;
constexpr std::size_t kMiddleKnuckle = 12;
constexpr std::size_t kMaxNameBytes = 50;
constexpr Vec kForward{0.0, 0.0, -1.0};
constexpr Vec kUp{0.0, 1.0, 0.0};

Vec ModelPosition(std::size_t joint) {
    const float* x = kRestJoints[joint];
    return {static_cast<double>(x[0]), static_cast<double>(x[1]), static_cast<double>(x[2])};
}

Quat ModelRotation(std::size_t joint) {
    const float* x = kRestJoints[joint];
    return {static_cast<double>(x[3]), static_cast<double>(x[4]), static_cast<double>(x[5]), static_cast<double>(x[6])};
}

/// A rotation of the project's axes in Unreal's, as in ToUnreal.
Quat QuatToUnreal(const Quat& q) { return {-q.Z, q.X, -q.Y, q.W}; }

Quat MirroredIf(bool mirror, const Quat& q) { return mirror ? Quat{q.X, -q.Y, -q.Z, q.W} : q; }

/// The frame of a straight finger: -z along it, and +y out of its back, as on the model's finger.
Quat FingerFrame(std::size_t joint, const Vec& along) {
    const Quat model = ModelRotation(joint);
    const Vec back = Rotate(FromTo(Rotate(model, kForward), along), Rotate(model, kUp));
    const Quat first = FromTo(kForward, along);
    const Vec up = Rotate(first, kUp);
    const double half = 0.5 * std::atan2(Dot(Cross(up, back), along), Dot(up, back));
    const Vec axis = std::sin(half) * along;
    return Normalized(Quat{axis.X, axis.Y, axis.Z, std::cos(half)} * first);
}

/// Makes one profile. Between the rig and the profile, points are those of a right hand in the project's axes, in metres.
class Maker {
public:
    Maker(Side side, const RestHand& rest, HandProfile& out) : Left(side == Side::Left), Rest(rest), Out(out) {}

    std::string Make() {
        Out = HandProfile();
        std::string problem = FindPalm();
        if (!problem.empty()) return std::string("the ") + (Left ? "left" : "right") + " hand " + problem;
        Out.ToHand = QuatToUnreal(MirroredIf(Left, Inverse(ToProfile)));
        Set(1, Vec(), Quat());
        for (std::size_t finger = 0; finger < kFingers; ++finger) AddFinger(finger);
        Set(0, 0.5 * (1.0 + kMetacarpalBase) * PalmKnuckle(), Quat());
        return {};
    }

private:
    Vec AsRight(const Vec& v) const { return 0.01 * Vec{Left ? v.Y : -v.Y, v.Z, v.X}; }
    Vec InHand(const Vec& v) const { return 100.0 * Vec{v.Z, Left ? v.X : -v.X, v.Y}; }
    Vec InProfile(const Vec& v) const { return Rotate(ToProfile, AsRight(v)); }

    void Set(std::size_t joint, const Vec& p, const Quat& q) {
        const double side = Left ? -1.0 : 1.0;
        Out.HasJoint[joint] = true;
        Out.Joints[joint] = {side * p.X, p.Y, p.Z, q.X, side * q.Y, side * q.Z, q.W};
    }

    /// Finds the rotation to the frame in which the knuckles lie as the model's do.
    std::string FindPalm() {
        std::vector<std::size_t> roots;
        for (std::size_t bone = 3; bone < kFingerBones; bone += 3)
            if (Rest.HasBone[bone]) roots.push_back(bone);
        if (roots.size() < 2 && Rest.HasBone[0]) roots.push_back(0);
        if (roots.size() < 2) return "has only one finger, so that its palm cannot be found; use a bone map";
        std::vector<Vec> ours, theirs;
        double ourSize = 0.0, theirSize = 0.0;
        for (const std::size_t bone : roots) {
            ours.push_back(AsRight(Rest.Positions[bone]));
            theirs.push_back(ModelPosition(JointOfBone(bone)));
            ourSize += Dot(ours.back(), ours.back());
            theirSize += Dot(theirs.back(), theirs.back());
        }
        if (!(ourSize > 1e-8)) return "has all its fingers in one place";
        ToProfile = AlignPoints(ours, theirs);
        const double scale = std::sqrt(theirSize / ourSize);
        double error = 0.0;
        Vec knuckles;
        for (std::size_t i = 0; i < roots.size(); ++i) {
            const Vec turned = Rotate(ToProfile, ours[i]);
            error = std::max(error, Length(scale * turned - theirs[i]));
            knuckles = knuckles + (1.0 / static_cast<double>(roots.size())) * turned;
        }
        if (error > kKnucklesOffM)
            return "has knuckles that do not lie side by side; check the names of its bones, or use a bone map";
        return IsThumbWrong(knuckles) ? "has its thumb on the wrong side, so that it is the other hand or a mirrored one; "
                                        "correct the side or the negative scale"
                                      : std::string();
    }

    /// The thumb tells a hand from its mirror image, whose knuckles lie alike.
    bool IsThumbWrong(const Vec& knuckles) const {
        for (const std::size_t bone : {2U, 1U, 0U}) {
            if (!Rest.HasBone[bone]) continue;
            const Vec tip = InProfile(Rest.Positions[bone]);
            return tip.X > knuckles.X || tip.Y > knuckles.Y + kThumbBehind * Length(knuckles);
        }
        return false;
    }

    void AddFinger(std::size_t finger) {
        std::vector<std::size_t> chain;
        for (std::size_t bone = 3 * finger; bone < 3 * finger + 3; ++bone)
            if (Rest.HasBone[bone]) chain.push_back(bone);
        if (chain.empty()) return;
        std::vector<Vec> points;
        for (const std::size_t bone : chain) points.push_back(InProfile(Rest.Positions[bone]));
        points.push_back(Tip(finger, points));
        for (std::size_t i = 0; i < chain.size(); ++i) Out.Ends[chain[i]] = InHand(Rotate(Inverse(ToProfile), points[i + 1]));
        const Vec along = Unit(points[1] - points[0]);
        const Quat frame = FingerFrame(JointOfBone(chain[0]), along);
        Vec at = points[0];
        for (std::size_t i = 0; i < chain.size(); ++i) {
            Set(JointOfBone(chain[i]), at, frame);
            at = at + Length(points[i + 1] - points[i]) * along;
        }
        Set(5 + 5 * finger, at, frame);
        if (finger == 0) return;
        const bool known = Rest.HasMetacarpal[finger];
        Set(1 + 5 * finger, known ? InProfile(Rest.Metacarpals[finger]) : kMetacarpalBase * points[0], Quat());
    }

    Vec Tip(std::size_t finger, const std::vector<Vec>& points) const {
        if (Rest.HasTip[finger]) return InProfile(Rest.Tips[finger]);
        const Vec before = points.size() > 1 ? points.back() - points[points.size() - 2] : Vec{0.0, 0.0, -0.03};
        return points.back() + kTipShare * before;
    }

    /// The knuckle of the middle finger, or the mean of the others where it is missing, as that of a right hand.
    Vec PalmKnuckle() const {
        const double side = Left ? -1.0 : 1.0;
        Vec sum;
        int count = 0;
        for (std::size_t finger = 1; finger < kFingers; ++finger) {
            const std::size_t joint = JointOfBone(3 * finger);
            if (!Out.HasJoint[joint]) continue;
            const Vec knuckle{side * Out.Joints[joint][0], Out.Joints[joint][1], Out.Joints[joint][2]};
            if (joint == kMiddleKnuckle) return knuckle;
            sum = sum + knuckle;
            ++count;
        }
        return (1.0 / std::max(count, 1)) * sum;
    }

    const bool Left;
    const RestHand& Rest;
    HandProfile& Out;
    Quat ToProfile;
};

std::string JointsJson(const HandProfile& hand) {
    std::string text = "[";
    for (std::size_t joint = 0; joint < hand.Joints.size(); ++joint) {
        text += joint > 0 ? ", " : "";
        if (!hand.HasJoint[joint]) {
            text += "null";
            continue;
        }
        for (std::size_t i = 0; i < 7; ++i) {
            char number[32];
            std::snprintf(number, sizeof number, "%.9g", hand.Joints[joint][i]);
            text += (i > 0 ? ", " : "[") + std::string(number);
        }
        text += "]";
    }
    return text + "]";
}

}  // namespace

Quat HandProfile::Rotation(std::size_t joint) const {
    const Joint& x = Joints[joint];
    return QuatToUnreal({x[3], x[4], x[5], x[6]});
}

std::string MakeProfile(Side side, const RestHand& rest, HandProfile& profile) { return Maker(side, rest, profile).Make(); }

HandRig ExactRig(const RestHand& rest, const HandProfile& profile) {
    std::array<Quat, kFingerBones> bind{};
    const Vec forward = PositionOf(ToUnreal(std::array<float, 7>{0, 0, -1, 0, 0, 0, 1}.data()));
    for (std::size_t bone = 0; bone < kFingerBones; ++bone) {
        if (!rest.HasBone[bone]) continue;
        const Quat frame = profile.ToHand * profile.Rotation(JointOfBone(bone));
        // The profile's fingers are straight; the character's need not be.
        const Quat straight = FromTo(profile.Ends[bone] - rest.Positions[bone], Rotate(frame, forward));
        bind[bone] = Inverse(frame) * straight * rest.Rotations[bone];
    }
    return HandRig(profile.ToHand, bind);
}

std::string ProfileJson(const std::string& name, const HandProfile* left, const HandProfile* right) {
    std::string text = "{\"name\": " + QuotedJson(name);
    if (left != nullptr) text += ", \"left\": {\"joints\": " + JointsJson(*left) + "}";
    if (right != nullptr) text += ", \"right\": {\"joints\": " + JointsJson(*right) + "}";
    return text + "}";
}

std::string ProfileName(const std::string& character, const std::string& actor, const HandProfile* left, const HandProfile* right) {
    std::string name;
    for (const char c : character) {
        const bool kept = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '-' || c == '.';
        if (name.size() < kMaxNameBytes) name += kept ? c : '_';
    }
    std::uint32_t hash = 2166136261U;
    for (const char c : actor + ProfileJson("", left, right)) hash = (hash ^ static_cast<unsigned char>(c)) * 16777619U;
    char digits[16];
    std::snprintf(digits, sizeof digits, "_%04x", static_cast<unsigned>((hash >> 16) ^ (hash & 0xFFFFU)));
    return name + digits;
}

}  // namespace manipnet
