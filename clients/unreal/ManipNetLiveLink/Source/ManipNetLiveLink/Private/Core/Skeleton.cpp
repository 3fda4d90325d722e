#include "Skeleton.h"

namespace manipnet {
namespace {

/// The order of joints, because Live Link needs parents before children and OpenXR has the palm before the wrist.
std::size_t JointOf(std::size_t bone) { return bone < 2 ? 1 - bone : bone; }

struct Vec {
    double X, Y, Z;
};

struct Quat {
    double X, Y, Z, W;
};

Quat Inverse(const Quat& q) { return {-q.X, -q.Y, -q.Z, q.W}; }

Quat Multiply(const Quat& a, const Quat& b) {
    return {a.W * b.X + a.X * b.W + a.Y * b.Z - a.Z * b.Y, a.W * b.Y - a.X * b.Z + a.Y * b.W + a.Z * b.X,
            a.W * b.Z + a.X * b.Y - a.Y * b.X + a.Z * b.W, a.W * b.W - a.X * b.X - a.Y * b.Y - a.Z * b.Z};
}

Vec Rotate(const Quat& q, const Vec& v) {
    const Vec t{2.0 * (q.Y * v.Z - q.Z * v.Y), 2.0 * (q.Z * v.X - q.X * v.Z), 2.0 * (q.X * v.Y - q.Y * v.X)};
    return {v.X + q.W * t.X + q.Y * t.Z - q.Z * t.Y, v.Y + q.W * t.Y + q.Z * t.X - q.X * t.Z,
            v.Z + q.W * t.Z + q.X * t.Y - q.Y * t.X};
}

UnrealPose Relative(const UnrealPose& parent, const UnrealPose& child) {
    const Quat back = Inverse({parent.QX, parent.QY, parent.QZ, parent.QW});
    const Vec p = Rotate(back, {child.X - parent.X, child.Y - parent.Y, child.Z - parent.Z});
    const Quat q = Multiply(back, {child.QX, child.QY, child.QZ, child.QW});
    return {p.X, p.Y, p.Z, q.X, q.Y, q.Z, q.W};
}

}  // namespace

const char* Skeleton::BoneName(std::size_t bone) { return layout::kJointNames[JointOf(bone)]; }

int Skeleton::ParentOf(std::size_t bone) {
    const int parent = layout::kJointParents[JointOf(bone)];
    return parent < 0 ? -1 : static_cast<int>(JointOf(static_cast<std::size_t>(parent)));
}

void Skeleton::LocalPoses(const HandFrame& hand, Poses& output) {
    Poses world;
    for (std::size_t bone = 0; bone < kBones; ++bone) {
        world[bone] = ToUnreal(&hand.Joints[7 * JointOf(bone)]);
        const int parent = ParentOf(bone);
        output[bone] = parent < 0 ? world[bone] : Relative(world[static_cast<std::size_t>(parent)], world[bone]);
    }
}

}  // namespace manipnet
