"""The second solve: the pose of the model's hand carried onto the hand of an avatar, tick by tick.

It knows no clock, socket or file. `ik.carry` has the method.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Final

import numpy as np

from manipnet.geometry import Array, Side, mirror_poses, quat_rotate
from manipnet.synthesis.hand.avatar import AvatarHand
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.hand.model_profile import OUR_JOINTS
from manipnet.synthesis.hand.openxr import openxr_frames
from manipnet.synthesis.hand.places import place_joints
from manipnet.synthesis.hand.profile import FINGERS
from manipnet.synthesis.ik.carry import (
    CALM_WEIGHT_M2,
    CONTACT_WEIGHT,
    MAX_SHIFT_M,
    PAD_WEIGHT,
    TIP_WEIGHT,
    carry_contacts,
)
from manipnet.synthesis.ik.carry_samples import Samples
from manipnet.synthesis.objects.shape import Shape
from manipnet.wire.hand_names import BONE_NAMES, OPENXR_JOINT_NAMES

ONSET_SHARE: Final = 0.25
"""Share of the way that contact comes in, and goes out, at each tick when an object appears or is lost."""
PACE_POWER: Final = 2.5
"""Fingers that are longer than the model's follow it more gently, by this power of the ratio of lengths."""
RATIOS: Final = (0.75, 1.3)
"""Ratios of lengths beyond these count as these, or the fingers of a giant would come too late."""
CALM_POWER: Final = 4.0
"""How much more firmly longer fingers are kept to the last tick's difference from the model."""
SHORT_CALM_POWER: Final = 1.0
"""How much less firmly shorter fingers are; they work at the end of their reach, where a loose one trembles."""
_ALONG: Final = (1.0 / 3.0, 2.0 / 3.0, 1.0)
_ALONG_TIP: Final = (0.25, 0.5, 0.75, 1.0)
_ALONG_PALM: Final = (0.3, 0.65, 1.0)
"""Fractions of a capsule at which it is sampled; the forearm begins before 0.3 of the palm's."""

Held = tuple[Shape, Array, float]
"""An object near a hand: its shape, the pose `(7,)` of its mesh frame in the world, and its scale."""


@dataclass(frozen=True, eq=False)
class AvatarPose:
    """An avatar's hand at one tick, in the world."""

    angles: Array
    """`(A,)` radians."""
    rotations: Array
    """`(17, 4)` turn of each bone from the profile's rest pose, in the bone's own frame; the identity for a bone that
    the avatar lacks."""
    wrist: Array
    """`(7,)` in our wrist frame."""
    joints: Array
    """`(26, 7)` OpenXR."""


class HandCarrier:
    """One hand of an avatar from tick to tick."""

    def __init__(self, avatar: AvatarHand, model: Hand, side: Side, max_shift_m: float = MAX_SHIFT_M) -> None:
        self.avatar, self._model, self._side = avatar, model, side
        self._samples, self._max_shift_m = samples_of(avatar, model), max_shift_m
        self._difference, self._shift = np.zeros(avatar.hand.angle_count), np.zeros(3)
        self._touching = 0.0
        self._held: Held | None = None
        self._angles: Array | None = None
        ratio = min(max(avatar.length_ratio, RATIOS[0]), RATIOS[1])
        self._pace = 1.0 / max(ratio, 1.0) ** PACE_POWER
        self._calm = CALM_WEIGHT_M2 * ratio ** (CALM_POWER if ratio > 1.0 else SHORT_CALM_POWER)
        self._signs = mirror_poses(np.ones(7)) if side == "left" else np.ones(7)
        self._followed: Array | None = None

    @property
    def shift(self) -> Array:
        """How far the wrist is moved from where it is tracked, `(3,)` in its own frame, as a right hand."""
        return self._shift

    def step(self, model_angles: Array, wrist: Array, held: Held | None, size: float = 1.0) -> AvatarPose:
        """The avatar's hand for a model's hand with `model_angles (A_model,)` at `wrist (7,)` in the world.

        `held` is the object that the hand is near, or None; `size` is the actor's hand size relative to the model's.
        """
        avatar, mirrored = self.avatar, self._side == "left"
        self._held = held or self._held
        self._touching += ONSET_SHARE * ((held is not None) - self._touching)
        angles = np.empty(avatar.hand.angle_count)
        if self._followed is None:
            self._followed = avatar.follow @ model_angles
        if self._held is None:
            lower, upper = avatar.hand.limits.T
            np.clip(avatar.follow @ model_angles, lower, upper, angles)
        else:
            shape, pose, scale = self._held
            carry_contacts(
                self._model.packed,
                avatar.hand.packed,
                self._samples,
                avatar.follow,
                avatar.hand.limits,
                shape.field,
                wrist * self._signs,
                pose * self._signs,
                mirrored,
                float(scale),
                float(size),
                self._touching,
                self._max_shift_m,
                model_angles,
                self._pace,
                self._calm,
                self._followed,
                self._difference,
                angles,
                self._shift,
            )
        self._angles = angles
        return self._placed(wrist)

    def hold(self, model_angles: Array, wrist: Array) -> AvatarPose:
        """The hand with the fingers of the last tick, at `wrist (7,)`; before the first tick, as `step` makes it."""
        return self.step(model_angles, wrist, None) if self._angles is None else self._placed(wrist)

    def _placed(self, wrist: Array) -> AvatarPose:
        avatar, mirrored, angles = self.avatar, self._side == "left", self._angles
        assert angles is not None
        moved, rotations, joints = np.empty(7), np.empty((len(BONE_NAMES), 4)), np.empty((len(OPENXR_JOINT_NAMES), 7))
        place_joints(avatar.hand.packed, avatar.places, angles, wrist, self._shift, mirrored, moved, rotations, joints)
        return AvatarPose(angles, rotations, moved, joints)


@lru_cache(64)
def samples_of(avatar: AvatarHand, model: Hand) -> Samples:
    """Where the avatar's hand is compared with the model's."""
    hand = avatar.hand
    zero = forward_kinematics(model, np.zeros(model.angle_count))[0]
    frames = openxr_frames(model)
    joints, fractions, offsets, radii, weights, first, pads = [], [], [], [], [], [], []
    openxr = [OPENXR_JOINT_NAMES.index(name) if name != "WRIST" else 1 for name in hand.joint_names]
    model_radius = {
        tuple(capsule): radius for capsule, radius in zip(model.capsules.tolist(), model.radii, strict=True)
    }

    def add(start: int, end: int, fraction: float, radius: float, weight: float) -> None:
        a, b, at = _counterpart(openxr[start], openxr[end], fraction, zero)
        joints.append([start, end, a, b])
        fractions.append([fraction, at])
        offsets.append(np.zeros((2, 3)))
        radii.append([radius, model_radius.get((a, b), model_radius.get((0, b), 0.01))])
        weights.append(weight)

    capsules = list(zip(hand.capsules.tolist(), hand.radii, strict=True))
    for f, chain in enumerate(hand.fingers):
        first.append(len(joints))
        for (start, end), radius in capsules:
            if start in chain:
                along = _ALONG_TIP if end == chain[-1] else _ALONG
                for fraction in along:
                    is_tip = end == chain[-1] and fraction == 1.0
                    add(start, end, fraction, radius, TIP_WEIGHT if is_tip else CONTACT_WEIGHT / len(along))
        tip, bone = int(avatar.tip_joints[f]), chain[-2]
        a, b, _ = _counterpart(openxr[bone], tip, 1.0, zero)
        turns = np.stack([avatar.places.turns[tip], frames.offsets[0, tip]])
        model_tip = model_radius[(a, b)]
        pads.append(len(joints))
        joints.append([bone, chain[-1], a, b])
        fractions.append([1.0, 1.0])
        offsets.append(quat_rotate(turns, np.array([0.0, -1.0, 0.0])) * np.array([[avatar.radii[tip]], [model_tip]]))
        radii.append([0.0, 0.0])
        weights.append(PAD_WEIGHT)
    first.append(len(joints))
    for (start, end), radius in capsules:
        if start == 0:
            for fraction in _ALONG_PALM:
                add(start, end, fraction, radius, CONTACT_WEIGHT / len(_ALONG_PALM))
    first.append(len(joints))
    return Samples(*(np.array(column) for column in (first, joints, fractions, offsets, radii, weights, pads)))


def _counterpart(start: int, end: int, fraction: float, zero: Array) -> tuple[int, int, float]:
    """The model's bone, as its two joints, and the fraction of it for a place between two OpenXR joints."""
    row = next((row for row in FINGERS if end in row), FINGERS[1])
    path = [OUR_JOINTS[start], *(OUR_JOINTS[k] for k in row if start < k <= end and OUR_JOINTS[k])]
    if start == 1:
        path = [0, OUR_JOINTS[end]]
    lengths = [float(np.linalg.norm(zero[b] - zero[a])) for a, b in pairwise(path)]
    at = fraction * sum(lengths)
    for (a, b), length in zip(pairwise(path), lengths, strict=True):
        if at <= length + 1e-12:
            return a, b, min(at / length, 1.0)
        at -= length
    return path[-2], path[-1], 1.0
