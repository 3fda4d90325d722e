"""The hand as OpenXR and WebXR know it: 26 joints whose frames obey one rule on both hands.

Rule: -z runs along the bone to the fingertip, +y out of the back of the hand (of the nail, for a finger). The frames of
our own bones are arbitrary, so each is turned by a fixed offset, found once on the flat hand.
Sources: OpenXR specification, XR_EXT_hand_tracking, "Conventions of hand joints"; WebXR Hand Input, "Skeleton joints".
VMC's (Unity's) finger bones are in `manipnet.streams.vmc`: their thumb names sit one joint higher than these.
"""

from collections.abc import Sequence
from typing import Final, Literal

import numpy as np

from manipnet.geometry import Array, matrix_to_quat, mirror_quats, quat_multiply, transform
from manipnet.hand.kinematics import forward_kinematics
from manipnet.hand.skeleton import BONE_COUNT, DOF_AXES, DOF_COUNT, DOF_JOINTS, DOF_NAMES, FINGER_JOINTS, PARENTS

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

_METACARPALS = slice(6, 26, 5)
_KNUCKLES = [chain[0] for chain in FINGER_JOINTS[1:]]

# The joints of ours behind thumb and fingers. The thumb's metacarpal is bone 2, which both carpal angles have turned.
_JOINTS = np.array([0, 0, *FINGER_JOINTS[0][1:], *(j for chain in FINGER_JOINTS[1:] for j in (0, *chain))])
_BONES = np.where(_JOINTS < BONE_COUNT, _JOINTS, PARENTS[_JOINTS])


def openxr_joints(sides: Sequence[Side], T_world_wrist: Array, positions: Array, rotations: Array) -> Array:
    """World poses `(N, 26, 7)` of the OpenXR joints of N hands, xyz and xyzw.

    `T_world_wrist (N, 7)`; joint `positions (N, 22, 3)` in metres and bone `rotations (N, 17, 4)` in each hand's own
    wrist frame, so mirrored already for a left hand. Tips are turned like the bone before them. Finger metacarpals,
    which our hand lacks, and the palm are turned like the wrist; the palm lies in the middle of the middle metacarpal.
    """
    wrist = T_world_wrist[:, None]
    joints = positions[:, _JOINTS]
    joints[:, _METACARPALS] = positions[:, :1] + _METACARPAL_BASE * (positions[:, _KNUCKLES] - positions[:, :1])
    joints[:, 0] = 0.5 * (joints[:, 11] + joints[:, 12])
    turned = quat_multiply(rotations[:, _BONES], np.stack([_OFFSETS[side] for side in sides]))
    return np.concatenate([transform(wrist, joints), quat_multiply(wrist[..., 3:], turned)], axis=-1)


def _flat_hand_offsets() -> Array:
    """For each OpenXR joint its frame in that of the bone it follows, `(26, 4)`, on a flat right hand."""
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
    return matrix_to_quat(np.swapaxes(matrices, 1, 2) @ frames)[_BONES]


def _frame(along: Array, hinge: Array) -> Array:
    """Columns x, y, z of a bone pointing `along` that flexes about `hinge`, toward the palm."""
    z, y = -along, np.cross(along, hinge)
    columns = np.stack([np.cross(y, z), y, z], axis=1)
    return columns / np.linalg.norm(columns, axis=0)


_RIGHT = _flat_hand_offsets()
_OFFSETS: Final[dict[Side, Array]] = {"right": _RIGHT, "left": mirror_quats(_RIGHT)}
