#pragma once

#include "Geometry.h"

namespace manipnet {

/// A pose in Unreal's axes: left-handed, Z up, centimetres; quaternion xyzw.
struct UnrealPose {
    double X, Y, Z;
    double QX, QY, QZ, QW;
};

/// Converts a `pose` with position xyz and quaternion xyzw in the project's axes (right-handed, Y up, metres). The
/// position (x, y, z) becomes (z, -x, y), as in OptiTrack's Live Link plugin, so that both share one level.
inline UnrealPose ToUnreal(const float* pose) {
    return {100.0 * pose[2], -100.0 * pose[0], 100.0 * pose[1], -static_cast<double>(pose[5]), pose[3],
            -static_cast<double>(pose[4]), pose[6]};
}

inline Vec PositionOf(const UnrealPose& pose) { return {pose.X, pose.Y, pose.Z}; }
inline Quat RotationOf(const UnrealPose& pose) { return {pose.QX, pose.QY, pose.QZ, pose.QW}; }
inline UnrealPose PoseOf(const Vec& p, const Quat& q) { return {p.X, p.Y, p.Z, q.X, q.Y, q.Z, q.W}; }

}  // namespace manipnet
