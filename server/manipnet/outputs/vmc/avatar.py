"""The poses of a VMC receiver's bones for the hands of an avatar, whose profile says where its bones are.

The receiver shows that very avatar: a bone's position is where the avatar has it, and its rotation leads from the
avatar's T-pose, in which all bones of a VRM humanoid have the world's axes. A profile that does not describe the T-pose
is taken as one whose fingers are as in its rest pose, with the palms down.
Sources: VMC protocol specification, marionette side; VRM 1.0 specification, humanoid.
"""

from itertools import pairwise
from typing import Final

import numpy as np

from manipnet.geometry import (
    SIDES,
    Array,
    Side,
    matrix_to_quat,
    quat_conjugate,
    quat_multiply,
    quat_rotate,
)
from manipnet.outputs.axes import to_unity
from manipnet.outputs.vmc.skeleton import FOREARM_M, shortest_turn
from manipnet.synthesis.hand.profile import FINGERS, HandProfile, ProfileHand
from manipnet.wire import HandPose

_WRIST: Final = 1
_PARTS: Final = ("Proximal", "Intermediate", "Distal")
BONES: Final = {
    joint: f"{finger}{part}"
    for finger, row in zip(("Thumb", "Index", "Middle", "Ring", "Little"), FINGERS, strict=True)
    for part, joint in zip(_PARTS, row[:3] if finger == "Thumb" else row[1:4], strict=True)
}
"""VMC's finger bones, without "Left" or "Right", by the OpenXR joint at which each one starts."""
_ALONG: Final[dict[Side, float]] = {"left": 1.0, "right": -1.0}
"""Where the arms of the T-pose point, along x, for a person who faces +z."""


class AvatarSkeleton:
    """Computes the poses of the bones of one avatar's hands."""

    def __init__(self, profile: HandProfile) -> None:
        self.profile = profile
        self._hands = {side: _HandSkeleton(side, profile.hands[side]) for side in SIDES}

    def bone_names(self, side: Side) -> list[str]:
        """VMC's names of the hand and of the finger bones that the avatar has."""
        return [side.capitalize() + bone for bone in ("Hand", *(BONES[k] for k in self._hands[side].joints))]

    def bone_poses(self, side: Side, pose: HandPose) -> Array:
        """Local poses `(N, 7)` of these bones in Unity's axes."""
        return self._hands[side].bone_poses(pose)


class _HandSkeleton:
    """One hand in its T-pose. Everything has the project's axes, and the avatar faces +z."""

    def __init__(self, side: Side, hand: ProfileHand) -> None:
        rest, places = hand.joints, hand.t_pose
        chains = [[k for k in row if k in BONES and not np.isnan(rest[k, 0])] for row in FINGERS]
        self.joints = [k for chain in chains for k in chain]
        """OpenXR joints at which the bones that the avatar has start."""
        parents = {k: before for chain in chains for before, k in pairwise([_WRIST, *chain])}
        order = [_WRIST, *self.joints]
        self._parents = np.array([order.index(parents[k]) for k in self.joints])
        roots = [chain[0] for chain in chains if chain]  # they turn with the palm, in every pose
        palm = _palm_down(side) if places is None else _turn_between(rest[roots, :3], places[roots])
        if places is None:
            places = quat_rotate(palm, rest[:, :3])
        self._offsets = np.stack(
            [places[k] - (0.0 if parents[k] == _WRIST else places[parents[k]]) for k in self.joints]
        )
        self._elbow = np.array([_ALONG[side] * FOREARM_M, 0.0, 0.0]) if hand.elbow is None else -hand.elbow
        straightened = _straightening(rest[:, :3], quat_rotate(quat_conjugate(palm), places))
        from_rest = quat_multiply(quat_conjugate(rest[order, 3:]), straightened[order])
        self._from_t_pose = quat_multiply(from_rest, quat_conjugate(palm))
        """`(N, 4)` the turn of each bone in the T-pose, seen from the frame of its joint in a message."""

    def bone_poses(self, pose: HandPose) -> Array:
        """Local poses `(N, 7)` in Unity's axes."""
        turns = quat_multiply(pose.joints[[_WRIST, *self.joints], 3:], self._from_t_pose)
        local = quat_multiply(quat_conjugate(turns[self._parents]), turns[1:])
        poses = np.vstack([np.concatenate([self._elbow, turns[0]]), np.hstack([self._offsets, local])])
        return to_unity(poses)


def _palm_down(side: Side) -> Array:
    """The OpenXR frame of a wrist in T-pose: -z along the arm, +y up."""
    along = _ALONG[side]
    return matrix_to_quat(np.array([[0.0, 0.0, -along], [0.0, 1.0, 0.0], [along, 0.0, 0.0]]))


def _turn_between(start: Array, end: Array) -> Array:
    """The rotation that brings points `(N, 3)` nearest to others, about the origin (Kabsch's method)."""
    u, _, v = np.linalg.svd(end.T @ start)
    return matrix_to_quat(u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))]) @ v)


def _straightening(rest: Array, bent: Array) -> Array:
    """The turn of each bone from where the T-pose has it to the rest pose, `(26, 4)`, both in the wrist's frame."""
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (len(rest), 1))
    for row in FINGERS:
        present = [k for k in row if k in BONES or k == row[-1]]
        present = [k for k in present if not np.isnan(rest[k, 0])]
        for k, after in pairwise(present):
            if not np.isnan(bent[[k, after]]).any():
                turns[k] = shortest_turn(_unit(bent[after] - bent[k]), _unit(rest[after] - rest[k]))
    return turns


def _unit(v: Array) -> Array:
    return v / np.linalg.norm(v)
