#pragma once

#include <array>

namespace manipnet {

/// A pose in Unreal's axes: left-handed, Z up, X forward (the project's -z), centimetres; quaternion xyzw.
struct UnrealPose {
    double X, Y, Z;
    double QX, QY, QZ, QW;
};

/// Converts a `pose` with position xyz and quaternion xyzw in the project's axes (right-handed, Y up, metres).
inline UnrealPose ToUnreal(const float* pose) {
    return {-100.0 * pose[2], 100.0 * pose[0], 100.0 * pose[1], pose[5], -static_cast<double>(pose[3]),
            -static_cast<double>(pose[4]), pose[6]};
}

}  // namespace manipnet
