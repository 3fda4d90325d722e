#pragma once

#include "Geometry.h"

namespace manipnet {

/// How the bones of an arm turn so that its wrist arrives at a target: rotations that come before (to the left of) those
/// that the bones have.
struct ArmTurn {
    Quat Upper;
    Quat Lower;
};

/// Solves an arm of two bones. The elbow stays in the plane in which it was, and a target that is out of reach is
/// approached with a straight arm.
ArmTurn SolveArm(const Vec& shoulder, const Vec& elbow, const Vec& wrist, const Vec& target);

}  // namespace manipnet
