"""The hand of an avatar: the profile on which the server solves contact, and the pose of its bones for each message.

A profile is made from the rest pose of a rig: the palm is turned so that the knuckles lie as the model's do, and each
finger is straightened along its first bone. `manipnet hand import` makes the same profile from a file.
Axes are right-handed and quaternions xyzw, as in the messages and in Blender.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .layout import JOINT_COUNT, REST_JOINTS, REST_RADII
from .message import Hand
from .retarget import conjugate, from_to, multiply, rotate

PALM, WRIST = 0, 1
FIRST_JOINTS = (2, 7, 12, 17, 22)
"""The OpenXR joint of the first bone of each finger, beyond the palm but for the thumb's."""
TIP_JOINTS = (5, 10, 15, 20, 25)
JOINTS = tuple(first + part for first in FIRST_JOINTS for part in range(3))
"""The OpenXR joint of each finger bone, thumb to little finger, proximal to distal."""

_METACARPAL_BASE = 0.3
"""Where a metacarpal begins on the way from the wrist to its knuckle, in rigs without such bones."""
_TIP_SHARE = 0.8
"""The last bone of a finger relative to the one before it, where nothing shows its end."""
_THUMB_BEHIND = 0.08
_KNUCKLES_OFF_M = 0.05
_RADIUS_SHARES = (0.5, 1.7)
_MEASURED = (0.3, 0.9)
"""Between which parts of a bone its radius is measured; nearer to its joints, the skin bulges into the palm or ends."""
_PALMAR = 0.6
"""Cosine of the largest angle between the direction of the palm and that in which a radius is measured."""
_MODEL_PALM_M = 0.107
_MIDDLE_KNUCKLE, _KNUCKLES = 6, (3, 6, 9, 12)
"""Rows of finger bones."""
_NAME_CHARACTERS = 40


class AvatarError(ValueError):
    """A hand cannot become a profile; the text says why and what to do."""


@dataclass(frozen=True, eq=False)
class RigHand:
    """The rest pose of one hand of a rig, in the space of its hand bone and in metres.

    `positions (15, 3)` and `rotations (15, 4)` are those of the finger bones, thumb to little finger, proximal to
    distal. `tips (5, 3)` are the known ends of the fingers, `ends (5, 3)` guesses of them, which count if there is no
    skin, and `metacarpals (4, 3)` the beginnings of the metacarpals of the other fingers. What a rig lacks is NaN.
    `skin (V, 3)` are points of the skin, of which `owners (V,)` says the finger bone.
    """

    positions: np.ndarray
    rotations: np.ndarray
    tips: np.ndarray
    ends: np.ndarray = field(default_factory=lambda: np.full((5, 3), np.nan))
    metacarpals: np.ndarray = field(default_factory=lambda: np.full((4, 3), np.nan))
    skin: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    owners: np.ndarray = field(default_factory=lambda: np.empty(0, int))


class AvatarHand:
    """One hand of an avatar, as the server solves it. Raises `AvatarError` for a hand that it cannot be.

    `joints (26, 7)` are the OpenXR joints at rest with straight fingers in the frame of the wrist joint, and
    `radii (26,)` the distances of the skin from them, metres. What the rig lacks is NaN.
    """

    def __init__(self, side: str, rig: RigHand) -> None:
        self._flip = np.array([-1.0, 1.0, 1.0]) if side == "left" else np.ones(3)
        turn = _palm_frame(side, rig.positions * self._flip)
        self._to_wrist = _mirrored(turn) if side == "left" else turn
        """The rotation from the frame of the wrist joint to the space of the hand bone."""
        self.joints, self.radii = np.full((JOINT_COUNT, 7), np.nan), np.full(JOINT_COUNT, np.nan)
        self._bind = np.tile([0.0, 0.0, 0.0, 1.0], (15, 1))
        self._points = _rotated(conjugate(self._to_wrist), rig.positions)
        for finger in range(5):
            self._add_finger(finger, rig)
        self._add_palm(rig)

    def hand_place(self, hand: Hand) -> np.ndarray:
        """Where the hand bone is in the world, `(3,)`."""
        return hand.joints[WRIST, :3]

    def hand_rotation(self, hand: Hand) -> np.ndarray:
        """The world rotation `(4,)` of the hand bone."""
        return multiply(hand.joints[WRIST, 3:], conjugate(self._to_wrist))

    def solve(self, hand: Hand) -> np.ndarray:
        """The rotations `(15, 4)` of the finger bones in the space of the hand bone.

        `hand` belongs to a message for this avatar. The bones then lie at the message's joints, whatever their own axes
        and however bent they are at rest.
        """
        to_hand = conjugate(self.hand_rotation(hand))
        out = [
            multiply(to_hand, multiply(hand.joints[joint, 3:], bind))
            for joint, bind in zip(JOINTS, self._bind, strict=True)
        ]
        return np.array(out) / np.linalg.norm(out, axis=1, keepdims=True)

    def content(self) -> dict[str, Any]:
        """This hand as a profile has it."""
        joints = [None if np.isnan(row).any() else row.round(7).tolist() for row in self.joints]
        return {"joints": joints, "radii": [None if np.isnan(r) else round(float(r), 6) for r in self.radii]}

    def _add_finger(self, finger: int, rig: RigHand) -> None:
        bones = [3 * finger + part for part in range(3) if not np.isnan(self._points[3 * finger + part, 0])]
        if not bones:
            return
        to_frame = conjugate(self._to_wrist)
        skin = _rotated(to_frame, rig.skin)
        points = [self._points[bone] for bone in bones]
        sure, guess = (rotate(to_frame, ends[finger]) for ends in (rig.tips, rig.ends))
        model = self._model(JOINTS[bones[0]])
        points.append(_tip(points, skin[rig.owners == bones[-1]], model, sure, guess))
        along = direction = _unit(points[1] - points[0])
        frame = bent = _bone_frame(along, model)
        at, palm = points[0], self._points[_MIDDLE_KNUCKLE]
        for bone, start, end in zip(bones, points, points[1:], strict=False):
            joint = JOINTS[bone]
            self.joints[joint] = [*at, *frame]
            guess = REST_RADII[joint] * np.linalg.norm(palm if not np.isnan(palm[0]) else start) / _MODEL_PALM_M
            bent, direction = multiply(from_to(direction, end - start), bent), end - start
            self.radii[joint] = _radius(skin[rig.owners == bone], start, end, _palmar(bent), guess)
            straight = multiply(from_to(end - start, along), multiply(to_frame, rig.rotations[bone]))
            self._bind[bone] = multiply(conjugate(frame), straight)
            at = at + np.linalg.norm(end - start) * along
        self.joints[TIP_JOINTS[finger]] = [*at, *frame]
        self.radii[TIP_JOINTS[finger]] = self.radii[JOINTS[bones[-1]]]

    def _add_palm(self, rig: RigHand) -> None:
        level = [0.0, 0.0, 0.0, 1.0]
        self.joints[WRIST] = [0.0, 0.0, 0.0, *level]
        there = [finger for finger in range(1, 5) if not np.isnan(self._first(finger)).any()]
        for finger in there:
            base = rotate(conjugate(self._to_wrist), rig.metacarpals[finger - 1])
            base = _METACARPAL_BASE * self._first(finger) if np.isnan(base).any() else base
            self.joints[FIRST_JOINTS[finger] - 1] = [*base, *level]
        middle = self.joints[FIRST_JOINTS[2], :3]
        if np.isnan(middle).any():
            middle = np.nanmean([self.joints[FIRST_JOINTS[finger], :3] for finger in range(1, 5)], axis=0)
        self.joints[PALM] = [*(0.5 * (1.0 + _METACARPAL_BASE) * middle), *level]

    def _first(self, finger: int) -> np.ndarray:
        """Where the first bone of a finger that the rig has begins; NaN without the finger."""
        joints = self.joints[FIRST_JOINTS[finger] : FIRST_JOINTS[finger] + 3, :3]
        return next((row for row in joints if not np.isnan(row[0])), np.full(3, np.nan))

    def _model(self, joint: int) -> np.ndarray:
        """The rotation of a joint of the model's hand on this side."""
        return REST_JOINTS[joint, 3:] * (np.array([1.0, -1.0, -1.0, 1.0]) if self._flip[0] < 0.0 else 1.0)


def avatar_profile(name: str, hands: Mapping[str, AvatarHand], actor: str = "") -> dict[str, Any]:
    """The profile of an avatar from its hands, by side; a hand that is missing is the mirror image of the other.

    Its name in the server is `name` without what a name must not have, and a few characters that depend on the hands
    and on the `actor`, so that two avatars never share one by accident, and one always has the same.
    """
    content = {side: hand.content() for side, hand in hands.items()}
    places = {side: (np.nan_to_num(hand.joints[:, :3]).round(4) + 0.0).tolist() for side, hand in hands.items()}
    digest = hashlib.sha256(json.dumps([places, actor], sort_keys=True).encode()).hexdigest()[:8]
    plain = "".join(c if c.isascii() and c.isalnum() else "-" for c in name)[:_NAME_CHARACTERS]
    return {"name": f"{plain}-{digest}", **content}


def _palm_frame(side: str, positions: np.ndarray) -> np.ndarray:
    """The rotation `(4,)` to the positions of a right hand from the frame in which they lie as the model's do.

    `positions (15, 3)` are those of finger bones relative to the hand bone. Raises `AvatarError`.
    """
    roots = [row for row in _KNUCKLES if not np.isnan(positions[row, 0])]
    if len(roots) < 2 and not np.isnan(positions[0, 0]):
        roots.append(0)
    if len(roots) < 2:
        raise AvatarError(f"the {side} hand needs the first bones of two fingers, so that its palm can be found")
    ours, theirs = positions[roots], REST_JOINTS[[JOINTS[row] for row in roots], :3]
    u, _, v = np.linalg.svd(ours.T @ theirs)  # Kabsch's method
    turn = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))]) @ v
    scale = np.linalg.norm(theirs) / np.linalg.norm(ours)
    off_m = float(np.linalg.norm(scale * ours @ turn - theirs, axis=1).max())
    if off_m > _KNUCKLES_OFF_M:
        raise AvatarError(
            f"the knuckles of the {side} hand do not lie side by side as on a hand ({1000 * off_m:.0f} mm off); check "
            "which bones its fingers have"
        )
    thumb = [row for row in range(3) if not np.isnan(positions[row, 0])]
    if thumb:
        last, knuckles = positions[thumb[-1]] @ turn, (ours @ turn).mean(axis=0)
        if last[0] > knuckles[0] or last[1] > knuckles[1] + _THUMB_BEHIND * np.linalg.norm(knuckles):
            raise AvatarError(
                f"the thumb of the {side} hand lies on the wrong side: it is the other hand, or a mirrored one"
            )
    return _quaternion(turn)


def _tip(
    points: list[np.ndarray], skin: np.ndarray, model: np.ndarray, sure: np.ndarray, guess: np.ndarray
) -> np.ndarray:
    """Where a finger ends: at its known tip, where its skin does, at the guess, or by the length of its bone before."""
    if not np.isnan(sure[0]):
        return sure
    before = points[-1] - points[-2] if len(points) > 1 else np.array([0.0, 0.0, -0.03])
    along = _unit(before)
    if len(skin) > 8:
        at = (skin - points[-1]) @ along
        away = skin - points[-1] - at[:, None] * along
        facing = _facing(away, _palmar(_bone_frame(along, model)))
        radius = np.median(np.linalg.norm(away[facing] if facing.any() else away, axis=1))
        return points[-1] + max(at.max() - radius, 0.3 * np.linalg.norm(before)) * along
    return guess if not np.isnan(guess[0]) else points[-1] + _TIP_SHARE * before


def _radius(skin: np.ndarray, start: np.ndarray, end: np.ndarray, palmar: np.ndarray, guess: float) -> float:
    """The distance of the skin from a bone on the palmar side, which touches things.

    NaN where there is little skin, or it is not that of a finger.
    """
    along = end - start
    own = skin - start
    at = own @ along / max(float(along @ along), 1e-18)
    middle = (own - at[:, None] * along)[(at > _MEASURED[0]) & (at < _MEASURED[1])]
    facing = _facing(middle, palmar)
    if len(middle) < 6 or not facing.any():
        return np.nan
    radius = float(np.median(np.linalg.norm(middle[facing], axis=1)))
    return radius if _RADIUS_SHARES[0] * guess < radius < _RADIUS_SHARES[1] * guess else np.nan


def _palmar(frame: np.ndarray) -> np.ndarray:
    return rotate(frame, np.array([0.0, -1.0, 0.0]))


def _facing(away: np.ndarray, palmar: np.ndarray) -> np.ndarray:
    """Which of the vectors `(N, 3)` from a bone to its skin point to the palm."""
    return away @ palmar > _PALMAR * np.linalg.norm(away, axis=1)


def _bone_frame(along: np.ndarray, model: np.ndarray) -> np.ndarray:
    """The OpenXR rotation of a bone that points `along`: the model's, turned by as little as possible."""
    return multiply(from_to(rotate(model, np.array([0.0, 0.0, -1.0])), along), model)


def _rotated(q: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points `(N, 3)`, rotated."""
    t = 2.0 * np.cross(q[:3], points)
    return points + q[3] * t + np.cross(q[:3], t)


def _mirrored(q: np.ndarray) -> np.ndarray:
    return q * [1.0, -1.0, -1.0, 1.0]


def _unit(v: np.ndarray) -> np.ndarray:
    return v / max(float(np.linalg.norm(v)), 1e-12)


def _quaternion(m: np.ndarray) -> np.ndarray:
    """The quaternion `(4,)` of a rotation matrix `(3, 3)`."""
    rows = np.array(
        [
            [1 + m[0, 0] - m[1, 1] - m[2, 2], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[2, 1] - m[1, 2]],
            [m[0, 1] + m[1, 0], 1 - m[0, 0] + m[1, 1] - m[2, 2], m[1, 2] + m[2, 1], m[0, 2] - m[2, 0]],
            [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], 1 - m[0, 0] - m[1, 1] + m[2, 2], m[1, 0] - m[0, 1]],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], 1 + m[0, 0] + m[1, 1] + m[2, 2]],
        ]
    )
    best = rows[np.argmax(np.diag(rows))]
    return best / np.linalg.norm(best)
