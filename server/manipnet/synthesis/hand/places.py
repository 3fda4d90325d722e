"""Where the OpenXR joints are on the bones of an avatar's hand, and the hand posed in the world."""

from typing import NamedTuple

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import kernel, stack_array, vector
from manipnet.synthesis.hand.hand import MAX_ANGLES, MAX_JOINTS, Indices
from manipnet.synthesis.hand.kinematics import forward_kinematics_into
from manipnet.synthesis.hand.packed import unpack_skeleton
from manipnet.synthesis.rotations import matrix_to_quat_into, multiply_quats_into, quat_rotate_into

_positions, _rotations, _axes = stack_array(MAX_JOINTS, 3), stack_array(MAX_JOINTS, 3, 3), stack_array(MAX_ANGLES, 3)
_quats, _quat = stack_array(MAX_JOINTS, 4), stack_array(4)


class OpenXrPlaces(NamedTuple):
    """Where the 26 OpenXR joints are on the bones of a hand."""

    bones: Indices
    """`(26,)` the bone that each turns with."""
    points: Array
    """`(26, 3)` its position in that bone's frame."""
    turns: Array
    """`(26, 4)` its rotation in that bone's frame."""
    angle_of: Indices
    """`(17,)` the avatar's bone for each of the 17 bones of a message; -1 where it has none."""
    rest: Array
    """`(B, 4)` local rotation of each bone in the profile's rest pose."""
    own: Array
    """`(B, 4)` from the frame of each bone to that of its joint in the profile, which need not lie along the bone."""


@kernel
def place_joints(
    hand: np.ndarray,
    places: OpenXrPlaces,
    angles: Array,
    wrist: Array,
    shift: Array,
    left: bool,
    moved: Array,
    turns: Array,
    joints: Array,
):
    """Pose a hand with `angles (A,)` at `wrist (7,)`, moved by `shift (3,)` in the frame of a right hand's wrist.

    It is written into `moved (7,)`, the wrist, `turns (17, 4)`, which lead from the rest pose in the bones' own frames,
    and `joints (26, 7)` in the world.
    """
    skeleton, positions, rotations, axes = unpack_skeleton(hand), _positions(), _rotations(), _axes()
    quats, quat, turned, point = _quats(), _quat(), _quat(), vector()
    for i in range(3):
        point[i] = -shift[i] if left and i == 0 else shift[i]
    quat_rotate_into(wrist[3:], point, moved[:3])
    for i in range(7):
        moved[i] = moved[i] + wrist[i] if i < 3 else wrist[i]
    forward_kinematics_into(skeleton, angles, positions, rotations, axes)
    for bone in range(len(skeleton.rest)):
        matrix_to_quat_into(rotations[bone], False, quats[bone])
    for k in range(len(turns)):
        bone = places.angle_of[k]
        if bone < 0:
            turns[k, 0], turns[k, 1], turns[k, 2], turns[k, 3] = 0.0, 0.0, 0.0, 1.0
            continue
        multiply_quats_into(quats[max(skeleton.parents[bone], 0)], -1.0, quats[bone], quat)
        multiply_quats_into(places.rest[bone], -1.0, quat, turned)
        multiply_quats_into(places.own[bone], -1.0, turned, quat)
        multiply_quats_into(quat, 1.0, places.own[bone], turns[k])
        if left:
            turns[k, 1], turns[k, 2] = -turns[k, 1], -turns[k, 2]
    for k in range(len(joints)):
        bone = places.bones[k]
        for i in range(3):
            point[i] = positions[bone, i]
            for j in range(3):
                point[i] += rotations[bone, i, j] * places.points[k, j]
        multiply_quats_into(quats[bone], 1.0, places.turns[k], turned)
        if left:
            point[0], turned[1], turned[2] = -point[0], -turned[1], -turned[2]
        quat_rotate_into(wrist[3:], point, joints[k, :3])
        for i in range(3):
            joints[k, i] += moved[i]
        multiply_quats_into(wrist[3:], 1.0, turned, joints[k, 3:])
