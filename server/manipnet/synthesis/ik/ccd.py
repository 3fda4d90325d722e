"""Cyclic coordinate descent over the 20 hinges (paper, section 6.3; Aristidou and Lasenby 2011).

One hinge at a time, from the tip to the root, turns to the angle that brings all joints beyond it nearest to their
targets: with hinges that angle has a closed form.
"""

import numpy as np

from manipnet.jit import inner, stack_array, vector
from manipnet.synthesis.hand.kinematics import forward_kinematics_into
from manipnet.synthesis.hand.skeleton import BONE_COUNT, DOF_COUNT, DOF_JOINTS, PARENTS
from manipnet.synthesis.ik.chains import DOFS, FINGERS, MOVED_JOINTS, clamp, dof_moves

SWEEPS = 8
_positions, _rotations, _axes = stack_array(22, 3), stack_array(BONE_COUNT, 3, 3), stack_array(DOF_COUNT, 3)


@inner
def _best_turn(origin, axis, positions, targets, finger, dof):
    from_axis, to_axis = vector(), vector()
    sine = cosine = 0.0
    for j in MOVED_JOINTS[finger]:
        if j < 0 or not dof_moves(dof, PARENTS[j]):
            continue
        _off_axis(positions[j], origin, axis, from_axis)
        _off_axis(targets[j], origin, axis, to_axis)
        for i in range(3):
            k, m = (i + 1) % 3, (i + 2) % 3
            sine += axis[i] * (from_axis[k] * to_axis[m] - from_axis[m] * to_axis[k])
            cosine += from_axis[i] * to_axis[i]
    return np.arctan2(sine, cosine) if sine != 0.0 or cosine != 0.0 else 0.0


@inner
def _off_axis(point, origin, axis, out):
    """The way to a point from the line through `origin` along `axis`, into `out (3,)`."""
    along = 0.0
    for i in range(3):
        along += axis[i] * (point[i] - origin[i])
    for i in range(3):
        out[i] = point[i] - origin[i] - along * axis[i]


@inner
def solve_ccd(start, targets, limits, angles):
    """From `start (20,)` to `angles (20,)` whose joints are near `targets (22, 3)`, inside `limits (20, 2)`."""
    for dof in range(DOF_COUNT):
        angles[dof] = start[dof]
    positions, rotations, axes = _positions(), _rotations(), _axes()
    for _ in range(SWEEPS):
        for step in range(DOFS):
            # the chains are independent, so all fingers turn the same link before positions are renewed
            forward_kinematics_into(angles, positions, rotations, axes)
            for finger in range(FINGERS):
                dof = DOFS * finger + DOFS - 1 - step
                turn = _best_turn(positions[DOF_JOINTS[dof]], axes[dof], positions, targets, finger, dof)
                angles[dof] = clamp(angles[dof] + turn, limits, dof)
