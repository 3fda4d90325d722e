"""The hand as OpenXR and WebXR know it: 26 joints whose frames obey one rule on both hands.

Rule: -z runs along the bone to the fingertip, +y out of the back of the hand (of the nail, for a finger). The frames of
our own bones are arbitrary, so each is turned by a fixed offset, found once on the flat hand.
Sources: OpenXR specification, XR_EXT_hand_tracking, "Conventions of hand joints"; WebXR Hand Input, "Skeleton joints".
VMC's (Unity's) finger bones are in `manipnet.outputs.vmc`: their thumb names sit one joint higher than these.
"""

from collections.abc import Sequence
from functools import cache
from typing import Final, Literal

import numpy as np

from manipnet.geometry import Array, matrix_to_quat, mirror_quats
from manipnet.jit import inner, kernel, stack_array, vector
from manipnet.synthesis.hand.kinematics import forward_kinematics, forward_kinematics_into
from manipnet.synthesis.hand.skeleton import (
    BONE_COUNT,
    DOF_AXES,
    DOF_COUNT,
    DOF_JOINTS,
    DOF_NAMES,
    FINGER_JOINTS,
    PARENTS,
)

Side = Literal["left", "right"]

_FINGERS = ("index", "middle", "ring", "little")

OPENXR_JOINT_NAMES: Final = (
    "palm",
    "wrist",
    *(f"thumb_{part}" for part in ("metacarpal", "proximal", "distal", "tip")),
    *(f"{f}_{part}" for f in _FINGERS for part in ("metacarpal", "proximal", "intermediate", "distal", "tip")),
)

OPENXR_PARENTS: Final = (1, -1, 1, 2, 3, 4, *(p for f in range(4) for p in (1, *range(6 + 5 * f, 10 + 5 * f))))
"""Parent of each OpenXR joint: everything hangs on the wrist, which has none (-1)."""


def webxr_name(joint: str) -> str:
    """An OpenXR joint's name in WebXR's spelling; WebXR itself has no palm."""
    finger, _, part = joint.partition("_")
    if not part:
        return joint
    if finger != "thumb":
        finger = f"{finger.replace('little', 'pinky')}-finger"
    return f"{finger}-{part}" if part in ("metacarpal", "tip") else f"{finger}-phalanx-{part}"


WEBXR_JOINT_NAMES: Final = tuple(webxr_name(name) for name in OPENXR_JOINT_NAMES[1:])
"""The 25 joints of WebXR: OpenXR's from the wrist on, in the same order."""

_METACARPAL_BASE = 0.3
"""Where a finger's metacarpal begins on the way from the wrist to its knuckle; our palm is one bone."""

_KNUCKLE_AFTER = np.array([0] * 6 + [joint for chain in FINGER_JOINTS[1:] for joint in (chain[0], 0, 0, 0, 0)])
"""The knuckle of ours at the end of each finger metacarpal, 0 for all other joints."""
_MIDDLE_KNUCKLE = FINGER_JOINTS[2][0]

# The joints of ours behind thumb and fingers. The thumb's metacarpal is bone 2, which both carpal angles have turned.
_JOINTS = np.array([0, 0, *FINGER_JOINTS[0][1:], *(j for chain in FINGER_JOINTS[1:] for j in (0, *chain))])
_BONES = np.where(_JOINTS < BONE_COUNT, _JOINTS, PARENTS[_JOINTS])

_positions, _rotations, _axes = stack_array(22, 3), stack_array(BONE_COUNT, 3, 3), stack_array(DOF_COUNT, 3)
_quats, _quat = stack_array(BONE_COUNT, 4), stack_array(4)


def pose_in_world(sides: Sequence[Side], angles: Array, T_world_wrist: Array, scale: float) -> tuple[Array, Array]:
    """Of N hands of the size `scale` with `angles (N, 20)` and wrists `(N, 7)`: bone rotations `(N, 17, 4)` local to
    the parent bone, and world poses `(N, 26, 7)` of the OpenXR joints, xyz and xyzw.

    Both are mirrored for a left hand; the wrist's rotation is the identity. Tips are turned like the bone before them.
    Finger metacarpals, which our hand lacks, and the palm are turned like the wrist; the palm lies in the middle of the
    middle metacarpal.
    """
    left = np.array([side == "left" for side in sides])
    local, joints = np.empty((len(left), BONE_COUNT, 4)), np.empty((len(left), len(_JOINTS), 7))
    _pose_in_world(angles, T_world_wrist, left, scale, _flat_hand_offsets(), local, joints)
    return local, joints


@inner
def _rotate(q, v, out):
    """The vector `v` turned by the unit quaternion `q`, into `out (3,)`."""
    tx, ty, tz = 2 * (q[1] * v[2] - q[2] * v[1]), 2 * (q[2] * v[0] - q[0] * v[2]), 2 * (q[0] * v[1] - q[1] * v[0])
    out[0] = v[0] + q[3] * tx + q[1] * tz - q[2] * ty
    out[1] = v[1] + q[3] * ty + q[2] * tx - q[0] * tz
    out[2] = v[2] + q[3] * tz + q[0] * ty - q[1] * tx


@inner
def _multiply(a, sign, b, out):
    """Product of the quaternions `a`, its vector part times `sign`, and `b`, into `out (4,)`."""
    ax, ay, az, aw = sign * a[0], sign * a[1], sign * a[2], a[3]
    x, y = aw * b[0] + ax * b[3] + ay * b[2] - az * b[1], aw * b[1] - ax * b[2] + ay * b[3] + az * b[0]
    z, w = aw * b[2] + ax * b[1] - ay * b[0] + az * b[3], aw * b[3] - ax * b[0] - ay * b[1] - az * b[2]
    out[0], out[1], out[2], out[3] = x, y, z, w


@inner
def _quat_into(m, mirrored, out):
    """Unit quaternion with w >= 0 of the rotation matrix `m`, or of its mirror image, into `out (4,)`.

    By the largest of the four squared components, so it is stable at every angle (Shepperd 1978).
    """
    squares = (1 + m[0, 0] - m[1, 1] - m[2, 2], 1 - m[0, 0] + m[1, 1] - m[2, 2], 1 - m[0, 0] - m[1, 1] + m[2, 2])
    w = 1 + m[0, 0] + m[1, 1] + m[2, 2]
    if w >= squares[0] and w >= squares[1] and w >= squares[2]:
        out[0], out[1], out[2], out[3] = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], w
    elif squares[0] >= squares[1] and squares[0] >= squares[2]:
        out[0], out[1], out[2], out[3] = squares[0], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[2, 1] - m[1, 2]
    elif squares[1] >= squares[2]:
        out[0], out[1], out[2], out[3] = m[0, 1] + m[1, 0], squares[1], m[1, 2] + m[2, 1], m[0, 2] - m[2, 0]
    else:
        out[0], out[1], out[2], out[3] = m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], squares[2], m[1, 0] - m[0, 1]
    length = np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2 + out[3] ** 2)
    gain = -1.0 / length if out[3] < 0.0 else 1.0 / length
    out[0] *= gain
    out[1] *= -gain if mirrored else gain
    out[2] *= -gain if mirrored else gain
    out[3] *= gain


@kernel
def _pose_in_world(angles, wrists, left, scale, offsets, local, joints):
    positions, rotations, axes = _positions(), _rotations(), _axes()
    quats, turned, point = _quats(), _quat(), vector()
    for n in range(len(angles)):
        forward_kinematics_into(angles[n], positions, rotations, axes)
        for bone in range(BONE_COUNT):
            _quat_into(rotations[bone], left[n], quats[bone])
            _multiply(quats[max(PARENTS[bone], 0)], -1.0, quats[bone], local[n, bone])
        wrist, own = wrists[n], joints[n]
        for i in range(len(_JOINTS)):
            for k in range(3):
                p = positions[_JOINTS[i], k]
                if _KNUCKLE_AFTER[i] > 0:
                    p = _METACARPAL_BASE * positions[_KNUCKLE_AFTER[i], k]
                if i == 0:
                    p = 0.5 * (1.0 + _METACARPAL_BASE) * positions[_MIDDLE_KNUCKLE, k]
                point[k] = scale * (-p if left[n] and k == 0 else p)
            _rotate(wrist[3:], point, own[i, :3])
            for k in range(3):
                own[i, k] += wrist[k]
            _multiply(quats[_BONES[i]], 1.0, offsets[1 if left[n] else 0, i], turned)
            _multiply(wrist[3:], 1.0, turned, own[i, 3:])


@cache
def _flat_hand_offsets() -> Array:
    """For each OpenXR joint its frame in that of the bone it follows, on a flat right and left hand, `(2, 26, 4)`."""
    positions, matrices = forward_kinematics(np.zeros(DOF_COUNT))
    hinges = {
        bone: matrices[PARENTS[bone]] @ axis
        for name, bone, axis in zip(DOF_NAMES, DOF_JOINTS.tolist(), DOF_AXES, strict=True)
        if name.endswith("_FE")
    }
    hinges[2] = hinges[3]  # the first carpal hinge rolls the thumb more than it bends it
    frames = np.empty((BONE_COUNT, 3, 3))
    frames[:2] = _frame(along=np.array([1.0, 0.0, 0.0]), hinge=np.array([0.0, 1.0, 0.0]))
    for bone in range(2, BONE_COUNT):
        child = PARENTS.tolist().index(bone)
        frames[bone] = _frame(positions[child] - positions[bone], hinges[bone])
    right = matrix_to_quat(np.swapaxes(matrices, 1, 2) @ frames)[_BONES]
    return np.stack([right, mirror_quats(right)])


def _frame(along: Array, hinge: Array) -> Array:
    """Columns x, y, z of a bone pointing `along` that flexes about `hinge`, toward the palm."""
    z, y = -along, np.cross(along, hinge)
    columns = np.stack([np.cross(y, z), y, z], axis=1)
    return columns / np.linalg.norm(columns, axis=0)
