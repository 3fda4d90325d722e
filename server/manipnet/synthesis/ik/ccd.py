"""Cyclic coordinate descent over the hinges (paper, section 6.3; Aristidou and Lasenby 2011).

One hinge at a time, from the tip to the root, turns to the angle that brings all joints beyond it nearest to their
targets. With hinges that angle has a closed form.
"""

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, stack_array, vector
from manipnet.synthesis.hand.hand import CHAIN_LENGTH, MAX_ANGLES, MAX_JOINTS, Chains, Skeleton
from manipnet.synthesis.hand.kinematics import forward_kinematics_into
from manipnet.synthesis.ik.chains import angle_moves, clamp

SWEEPS = 8
_positions, _rotations, _axes = stack_array(MAX_JOINTS, 3), stack_array(MAX_JOINTS, 3, 3), stack_array(MAX_ANGLES, 3)


@inner
def _best_turn(
    skeleton: Skeleton,
    chains: Chains,
    origin: Array,
    axis: Array,
    positions: Array,
    targets: Array,
    finger: int,
    angle: int,
):
    from_axis, to_axis = vector(), vector()
    sine = cosine = 0.0
    for k in range(CHAIN_LENGTH):
        j = chains.joints[finger, k]
        if j < 0 or not angle_moves(skeleton.angle_bones, angle, skeleton.parents[j]):
            continue
        _off_axis(positions[j], origin, axis, from_axis)
        _off_axis(targets[j], origin, axis, to_axis)
        for i in range(3):
            n, m = (i + 1) % 3, (i + 2) % 3
            sine += axis[i] * (from_axis[n] * to_axis[m] - from_axis[m] * to_axis[n])
            cosine += from_axis[i] * to_axis[i]
    return np.arctan2(sine, cosine) if sine != 0.0 or cosine != 0.0 else 0.0


@inner
def _off_axis(point: Array, origin: Array, axis: Array, out: Array):
    """The vector to a point from the line through `origin` along `axis`, into `out (3,)`."""
    along = 0.0
    for i in range(3):
        along += axis[i] * (point[i] - origin[i])
    for i in range(3):
        out[i] = point[i] - origin[i] - along * axis[i]


@inner
def solve_ccd(skeleton: Skeleton, chains: Chains, start: Array, targets: Array, limits: Array, angles: Array):
    """From `start (A,)` to `angles (A,)` whose joints are near `targets (J, 3)`, inside `limits (A, 2)`."""
    for angle in range(len(angles)):
        angles[angle] = start[angle]
    positions, rotations, axes = _positions(), _rotations(), _axes()
    for _ in range(SWEEPS):
        for step in range(CHAIN_LENGTH):
            # the fingers are independent, so all turn the same link before positions are computed again
            forward_kinematics_into(skeleton, angles, positions, rotations, axes)
            for finger in range(len(chains.angles)):
                angle = chains.angles[finger, CHAIN_LENGTH - 1 - step]
                if angle < 0:
                    continue
                origin = positions[skeleton.angle_bones[angle]]
                turn = _best_turn(skeleton, chains, origin, axes[angle], positions, targets, finger, angle)
                angles[angle] = clamp(angles[angle] + turn, limits, angle)
