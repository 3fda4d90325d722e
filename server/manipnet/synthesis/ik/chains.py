"""The five fingers as chains of four angles each, for the solvers: the wrist is fixed, so they are independent."""

import numpy as np

from manipnet.jit import inner
from manipnet.synthesis.hand.skeleton import CAPSULE_JOINTS, CAPSULE_RADII_M, DOF_JOINTS, FINGER_JOINTS

FINGERS = 5
DOFS = 4
"""Angles of finger `f` are `4 f … 4 f + 3`, from the root to the tip."""

MOVED_JOINTS = np.array([joints[-4:] if f == 0 else (*joints[-3:], -1) for f, joints in enumerate(FINGER_JOINTS)])
"""Joints each finger's angles move, `(5, 4)`, -1 where there is none: the thumb has four, the others three."""

CAPSULES = np.array([[4 + 3 * f + k for k in range(3)] for f in range(FINGERS)])
"""Capsules of each finger, `(5, 3)`."""
CAPSULE_STARTS, CAPSULE_ENDS = CAPSULE_JOINTS[:, 0].copy(), CAPSULE_JOINTS[:, 1].copy()
CAPSULE_RADII = CAPSULE_RADII_M.copy()


@inner
def dof_moves(dof, bone):
    """Whether the angle turns `bone` (both of one finger)."""
    return DOF_JOINTS[dof] <= bone


@inner
def clamp(value, limits, dof):
    """`value` inside the limits `(20, 2)` of an angle."""
    return min(max(value, limits[dof, 0]), limits[dof, 1])
