"""A hand as OpenXR and WebXR describe it: 26 joints whose frames obey one rule on both hands.

Rule: -z runs along the bone to the fingertip, +y out of the back of the hand (out of the nail, for a finger). The
frames of our own bones are arbitrary, so each is turned by a fixed offset, found once on the flat hand.
Sources: OpenXR specification, XR_EXT_hand_tracking, "Conventions of hand joints"; WebXR Hand Input, "Skeleton joints".
The finger bones of VMC (Unity's) are in `manipnet.outputs.vmc`: their thumb names sit one joint higher than these.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from manipnet.geometry import Array, Side, matrix_to_quat, mirror_quats
from manipnet.jit import kernel, stack_array, vector
from manipnet.synthesis.hand.hand import MAX_ANGLES, MAX_JOINTS, Hand, Indices
from manipnet.synthesis.hand.kinematics import forward_kinematics, forward_kinematics_into
from manipnet.synthesis.hand.packed import unpack_skeleton
from manipnet.synthesis.rotations import matrix_to_quat_into, multiply_quats_into, quat_rotate_into

METACARPAL_BASE: Final = 0.3
"""Where a finger's metacarpal begins on the way from the wrist to its knuckle; the palm of our hand is one bone."""
_HANDS_KEPT: Final = 32

_positions, _rotations, _axes = stack_array(MAX_JOINTS, 3), stack_array(MAX_JOINTS, 3, 3), stack_array(MAX_ANGLES, 3)
_quats, _quat = stack_array(MAX_JOINTS, 4), stack_array(4)


class OpenXrFrames(NamedTuple):
    """How the 26 OpenXR joints follow a hand's own."""

    joints: Indices
    """`(26,)` the joint on the way to which each lies from the wrist."""
    shares: Array
    """`(26,)` how far along that way: 1 at the joint itself."""
    bones: Indices
    """`(26,)` the bone that each turns with."""
    offsets: Array
    """`(2, 26, 4)` the frame of each in its bone's, on a right and on a left hand."""


def pose_in_world(
    hand: Hand, sides: Sequence[Side], angles: Array, T_world_wrist: Array, scale: float
) -> tuple[Array, Array]:
    """Poses of N hands of the size `scale` with `angles (N, A)` and wrists `(N, 7)`.

    Returns bone rotations `(N, B, 4)` local to the parent bone, the wrist's being the identity, and world poses
    `(N, 26, 7)` of the OpenXR joints, xyz and xyzw. Both are mirrored for a left hand. Tips turn with the bone before
    them. Finger metacarpals, which our hand lacks, and the palm turn with the wrist; the palm lies in the middle of the
    middle metacarpal.
    """
    count, bones, joints = len(sides), hand.bone_count, len(openxr_frames(hand).joints)
    rotations_at = 1 + hand.angle_count
    columns = 1, rotations_at, rotations_at + 4 * bones, rotations_at + 4 * bones + 7
    rows = np.empty((count, columns[-1] + 7 * joints))
    rows[:, 0], rows[:, 1:rotations_at], rows[:, columns[2] : columns[3]] = scale, angles, T_world_wrist
    place_in_world(hand, sides, columns, rows)
    local, placed = rows[:, rotations_at : columns[2]], rows[:, columns[3] :]
    return local.reshape(count, bones, 4).copy(), placed.reshape(count, joints, 7).copy()


def place_in_world(hand: Hand, sides: Sequence[Side], columns: tuple[int, int, int, int], rows: Array) -> None:
    """Complete `rows (N, …)` with the numbers of N hands by rotations and joints as `pose_in_world` has them.

    A row begins with the size, which is given. The `columns` are where angles, rotations, wrist and joints begin;
    angles and wrist are given too.
    """
    left = np.array([side == "left" for side in sides])
    _place_in_world(hand.packed, openxr_frames(hand), left, columns, rows)


@kernel
def _place_in_world(hand: np.ndarray, frames: OpenXrFrames, left: np.ndarray, columns: tuple[int, ...], rows: Array):
    skeleton, positions, rotations, axes = unpack_skeleton(hand), _positions(), _rotations(), _axes()
    quats, turned, point = _quats(), _quat(), vector()
    angles_at, rotations_at, wrist_at, joints_at = columns
    for n in range(len(rows)):
        row, scale, wrist = rows[n], rows[n, 0], rows[n, wrist_at : wrist_at + 7]
        forward_kinematics_into(skeleton, row[angles_at:rotations_at], positions, rotations, axes)
        for bone in range(len(skeleton.rest)):
            matrix_to_quat_into(rotations[bone], left[n], quats[bone])
            local = row[rotations_at + 4 * bone : rotations_at + 4 * bone + 4]
            multiply_quats_into(quats[max(skeleton.parents[bone], 0)], -1.0, quats[bone], local)
        for i in range(len(frames.joints)):
            for k in range(3):
                p = frames.shares[i] * positions[frames.joints[i], k]
                point[k] = scale * (-p if left[n] and k == 0 else p)
            joint = row[joints_at + 7 * i : joints_at + 7 * i + 7]
            quat_rotate_into(wrist[3:], point, joint[:3])
            for k in range(3):
                joint[k] += wrist[k]
            multiply_quats_into(quats[frames.bones[i]], 1.0, frames.offsets[1 if left[n] else 0, i], turned)
            multiply_quats_into(wrist[3:], 1.0, turned, joint[3:])


@lru_cache(_HANDS_KEPT)
def openxr_frames(hand: Hand) -> OpenXrFrames:
    """The frames of the OpenXR joints on a hand whose joints messages can carry (`wire.hand_names`)."""
    thumb, *fingers = hand.fingers
    middle_knuckle = fingers[1][0]
    # the thumb's metacarpal is its second bone, which both carpal angles have turned
    thumb_places = [(joint, 1.0, joint) for joint in thumb[1:]]
    places = [(middle_knuckle, 0.5 * (1.0 + METACARPAL_BASE), 0), (0, 1.0, 0), *thumb_places]
    for knuckle, *beyond in fingers:
        places += [(knuckle, METACARPAL_BASE, 0), *((joint, 1.0, joint) for joint in (knuckle, *beyond))]
    joints, shares, ends = (np.array(column) for column in zip(*places, strict=True))
    bones = np.where(ends < hand.bone_count, ends, hand.parents[ends])
    right = _bone_frames(hand)[bones]
    return OpenXrFrames(joints, shares, bones, np.stack([right, mirror_quats(right)]))


def _bone_frames(hand: Hand) -> Array:
    """For each bone the OpenXR frame in its own on the flat hand, `(B, 4)`."""
    positions, matrices = forward_kinematics(hand, np.zeros(hand.angle_count))
    hinges = {
        bone: matrices[hand.parents[bone]] @ axis
        for name, bone, axis in zip(hand.angle_names, hand.angle_bones.tolist(), hand.axes, strict=True)
        if name.endswith("_FE")
    }
    thumb = hand.fingers[0]
    hinges[thumb[1]] = hinges[thumb[2]]  # the first carpal hinge rolls the thumb more than it bends it
    frames = np.empty((hand.bone_count, 3, 3))
    frames[0] = frames[thumb[0]] = _frame(along=np.array([1.0, 0.0, 0.0]), hinge=np.array([0.0, 1.0, 0.0]))
    for bone in range(1, hand.bone_count):
        if bone != thumb[0]:
            child = hand.parents.tolist().index(bone)
            frames[bone] = _frame(positions[child] - positions[bone], hinges[bone])
    return matrix_to_quat(np.swapaxes(matrices, 1, 2) @ frames)


def _frame(along: Array, hinge: Array) -> Array:
    """Columns x, y, z of a bone that points `along` and flexes about `hinge`, toward the palm."""
    z, y = -along, np.cross(along, hinge)
    columns = np.stack([np.cross(y, z), y, z], axis=1)
    return columns / np.linalg.norm(columns, axis=0)
