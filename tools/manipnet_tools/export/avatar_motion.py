"""The bones of an avatar's own rig over time, from the OpenXR joints that were solved on its hands."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from manipnet.geometry import Array, Side, compose, invert
from manipnet.synthesis.hand.profile import FINGERS
from manipnet_tools.hands.importing import ImportedRig

_WRIST: Final = 1
_STILL: Final = {0, *(row[0] for row in FINGERS[1:]), *(row[-1] for row in FINGERS)}
"""Joints that do not turn about the bone above: the palm, the metacarpals in it, and the tips."""


class MovedBone(NamedTuple):
    """A bone of a hand."""

    parent_move: Array
    """`(T, 7)` how its parent moves in the world from the rest pose of the rig."""
    move: Array
    """`(T, 7)` how it moves itself."""
    is_hand: bool
    """Whether it is the bone of the hand, which is placed in the world; the others only turn."""


@dataclass(frozen=True, eq=False)
class AvatarMotion:
    """A rig and the motion of its hands over T frames."""

    rig: ImportedRig
    joints: Mapping[Side, Array]
    """The OpenXR joints `(T, 26, 7)` in the world, as they were solved."""
    bones: Mapping[int, MovedBone]
    """By number. Bones that are missing keep their place on the bone above."""


def avatar_motion(rig: ImportedRig, joints: Mapping[Side, Array]) -> AvatarMotion:
    """The motion of the bones of a rig whose hands have `joints (T, 26, 7)`.

    Arms stay as the rig has them, for the server knows only the hands.
    """
    bones: dict[int, MovedBone] = {}
    for side, hand in rig.hands.items():
        if side not in joints:
            continue
        moves = compose(joints[side], invert(hand.bind))
        known = rig.profile.hands[side].joints
        joint_of = {bone: k for k, bone in hand.bones.items() if k not in _STILL and not np.isnan(known[k, 0])}
        at_rest = np.tile([0.0, 0, 0, 0, 0, 0, 1], (len(moves), 1))
        for bone, joint in joint_of.items():
            above = _ancestor(rig.skeleton.parents, bone, joint_of)
            parent = at_rest if above is None else moves[:, joint_of[above]]
            bones[bone] = MovedBone(parent, moves[:, joint], joint == _WRIST)
    return AvatarMotion(rig, joints, bones)


def _ancestor(parents: list[int], bone: int, among: Mapping[int, int]) -> int | None:
    at = parents[bone]
    while at >= 0 and at not in among:
        at = parents[at]
    return at if at >= 0 else None
