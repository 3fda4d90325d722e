#pragma once

#include "Axes.h"

namespace manipnet {

/// Where the tracked space lies in the level: scaled about its origin, turned about the vertical, then moved.
struct Placement {
    double YawDegrees = 0.0;
    Vec Origin;  ///< Centimetres, in Unreal's axes.
    double Scale = 1.0;

    UnrealPose Place(const UnrealPose& pose) const {
        const double half = YawDegrees * 3.14159265358979323846 / 360.0;
        const Quat turn{0.0, 0.0, std::sin(half), std::cos(half)};
        return PoseOf(Origin + Rotate(turn, Scale * PositionOf(pose)), turn * RotationOf(pose));
    }
};

}  // namespace manipnet
