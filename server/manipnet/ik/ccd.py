"""Cyclic coordinate descent over the 20 hinges (paper, section 6.3; Aristidou and Lasenby 2011).

One hinge at a time, from the tip to the root, turns to the angle that brings all joints beyond it nearest to their
targets: with hinges that angle has a closed form.
"""

import numpy as np

from manipnet.hand.kinematics import forward_kinematics_into
from manipnet.hand.skeleton import BONE_COUNT, DOF_COUNT, DOF_JOINTS, PARENTS
from manipnet.ik.chains import DOFS, FINGERS, MOVED_JOINTS, clamp, dof_moves
from manipnet.kernels import inner

SWEEPS = 8


@inner
def _best_turn(origin, axis, positions, targets, finger, dof):
    sine = cosine = 0.0
    for j in MOVED_JOINTS[finger]:
        if j < 0 or not dof_moves(dof, PARENTS[j]):
            continue
        p, t = positions[j] - origin, targets[j] - origin
        p, t = p - axis * (p @ axis), t - axis * (t @ axis)
        sine += axis @ np.cross(p, t)
        cosine += p @ t
    return np.arctan2(sine, cosine) if sine != 0.0 or cosine != 0.0 else 0.0


@inner
def solve_ccd(start, targets, limits, angles):
    """From `start (20,)` to `angles (20,)` whose joints are near `targets (22, 3)`, inside `limits (20, 2)`."""
    for dof in range(DOF_COUNT):
        angles[dof] = start[dof]
    positions, rotations = np.empty((22, 3)), np.empty((BONE_COUNT, 3, 3))
    axes = np.empty((DOF_COUNT, 3))
    for _ in range(SWEEPS):
        for step in range(DOFS):
            # the chains are independent, so all fingers turn the same link before positions are renewed
            forward_kinematics_into(angles, positions, rotations, axes)
            for finger in range(FINGERS):
                dof = DOFS * finger + DOFS - 1 - step
                turn = _best_turn(positions[DOF_JOINTS[dof]], axes[dof], positions, targets, finger, dof)
                angles[dof] = clamp(angles[dof] + turn, limits, dof)
