"""How much of the model's contact survives on an avatar's hand: pads, penetration, smoothness and the drop test.

The measures are those of `evaluation.metrics`, on the avatar's own capsules. A pad is the point of the skin below a
fingertip, a radius from it toward the palm side.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from manipnet.geometry import SIDES, Array, Side, invert, quat_rotate, transform
from manipnet.synthesis.carrying import HandCarrier, Held
from manipnet.synthesis.hand.avatar import AvatarHand, avatar_hand
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.model_profile import model_profile
from manipnet.synthesis.hand.openxr import pose_in_world
from manipnet.synthesis.hand.profile import HandProfile
from manipnet.synthesis.objects.shape import Shape
from manipnet.wire.hand_names import OPENXR_JOINT_NAMES
from manipnet_tools.evaluation import metrics, physics
from manipnet_tools.evaluation.metrics import Mask

PAD_M = 0.003
"""A pad this near the surface touches it."""
DROP_FRAMES = 60


@dataclass(frozen=True)
class AvatarMotion:
    """One hand at T ticks: OpenXR joints `(T, 26, 7)` in the world, and the hand that they are of."""

    avatar: AvatarHand
    joints: Array

    @property
    def positions(self) -> Array:
        """The joints of the avatar's `Hand`, `(T, J, 3)`, in the world."""
        names = ("wrist", *self.avatar.hand.joint_names[1:])
        return self.joints[:, [OPENXR_JOINT_NAMES.index(name) for name in names], :3]

    @property
    def pads(self) -> Array:
        """`(T, F, 3)`, in the world."""
        tips = self.avatar.tip_joints
        tip = self.joints[:, tips]
        return tip[..., :3] - self.avatar.radii[tips][:, None] * quat_rotate(tip[..., 3:], np.array([0.0, 1.0, 0.0]))


@dataclass(frozen=True)
class HandMeasures:
    """What is left of the contact of one hand."""

    touching: int
    """Frames x fingers whose pad touches on the model's hand."""
    kept: float
    """Share of them whose pad touches on the avatar's."""
    capsules_kept: float
    """The same for the last capsules of the fingers, wherever they touch."""
    penetration_cm: tuple[float, float]
    """On the model's hand and on the avatar's."""
    smoothness: float
    """Of the avatar's joints in the frame of its wrist over the model's."""
    shift_mm: tuple[float, float]
    """Mean and largest shift of the wrist."""


def carry_take(
    model: Hand, profile: HandProfile, side: Side, angles: Array, wrist: Array, held: list[Held], size: float = 1.0
) -> tuple[AvatarMotion, AvatarMotion]:
    """The model's hand with `angles (T, A)` at `wrist (T, 7)`, and what is carried onto the avatar's."""
    own = avatar_hand(model_profile(model, side), side, model)
    sides: list[Side] = [side] * len(wrist)
    _, joints = pose_in_world(model, sides, angles, wrist, size)
    avatar = avatar_hand(profile.hands[side], side, model)
    carrier = HandCarrier(avatar, model, side)
    carried = [carrier.step(*each, size).joints for each in zip(angles, wrist, held, strict=True)]
    return AvatarMotion(own, joints), AvatarMotion(avatar, np.stack(carried))


def measure_hand(own: AvatarMotion, avatar: AvatarMotion, shape: Shape, T_world_object: Array) -> HandMeasures:
    """Compare an avatar's hand with the model's, both about one object with poses `(T, 7)`."""
    counts = metrics.settled(len(T_world_object))
    kept, touching = _kept(
        _pad_gaps(own, shape, T_world_object), _pad_gaps(avatar, shape, T_world_object), own, avatar, counts
    )
    gaps = [metrics.capsule_gaps(m.avatar.hand, m.positions, T_world_object, shape) for m in (own, avatar)]
    last = [gap.gap[:, _last_capsules(m)] for gap, m in zip(gaps, (own, avatar), strict=True)]
    capsules_kept, _ = _kept(last[0], last[1], own, avatar, counts)
    penetration = metrics.penetration_cm(gaps[0][counts]), metrics.penetration_cm(gaps[1][counts])
    smooth = [metrics.smoothness_cm_s2(_in_wrist(m), counts) for m in (own, avatar)]
    shift = 1e3 * np.linalg.norm(avatar.joints[:, 1, :3] - own.joints[:, 1, :3], axis=1)
    return HandMeasures(
        touching, kept, capsules_kept, penetration, smooth[1] / smooth[0], (float(shift.mean()), float(shift.max()))
    )


def drop_shares(
    own: Mapping[Side, AvatarMotion], avatar: Mapping[Side, AvatarMotion], shape: Shape, T_world_object: Array
) -> tuple[float, float, int]:
    """The shares of lifted frames in which the model's hands, and the avatar's, hold the object, and their number.

    Frames count in which a hand of the model's touches the object.
    """
    from manipnet_tools.evaluation.drop import DropTest  # needs the extra judge

    gaps = {
        side: metrics.capsule_gaps(m.avatar.hand, m.positions, T_world_object, shape).closest for side, m in own.items()
    }
    touches = {side: gap < metrics.CONTACT_M for side, gap in gaps.items()}
    lifted = physics.lifted(T_world_object, physics.body_of(shape)) & metrics.settled(len(T_world_object))
    frames = np.flatnonzero(lifted & np.logical_or(*touches.values()))
    if len(frames) > DROP_FRAMES:
        frames = frames[np.linspace(0, len(frames) - 1, DROP_FRAMES).round().astype(int)]
    held = np.zeros((2, len(frames)))
    for row, motions in enumerate((own, avatar)):
        hand = motions["right"].avatar.hand
        tests = {count: DropTest(shape, hand, count) for count in (1, 2)}
        for n, frame in enumerate(frames):
            back = invert(T_world_object[frame])
            down = quat_rotate(back[3:], np.array([0.0, -1.0, 0.0]))
            joints = [transform(back, motions[side].positions[frame]) for side in SIDES if touches[side][frame]]
            held[row, n] = tests[len(joints)].fall(joints, down).held
    return float(held[0].mean()), float(held[1].mean()), len(frames)


def _kept(before: Array, after: Array, own: AvatarMotion, avatar: AvatarMotion, counts: Mask) -> tuple[float, int]:
    """The share of the fingers that touch before and touch after, and the number of those before."""
    fingers = [own.avatar.tip_joints.tolist().index(tip) for tip in avatar.avatar.tip_joints.tolist()]
    touched = (np.abs(before[:, fingers]) < PAD_M) & counts[:, None]
    if not touched.any():
        return float("nan"), 0
    return float((np.abs(after) < PAD_M)[touched].mean()), int(touched.sum())


def _pad_gaps(motion: AvatarMotion, shape: Shape, T_world_object: Array) -> Array:
    """Signed distances of the pads to the object, `(T, F)`."""
    p_object = transform(invert(T_world_object)[:, None], motion.pads)
    return shape.signed_distance(p_object.reshape(-1, 3))[0].reshape(p_object.shape[:2])


def _last_capsules(motion: AvatarMotion) -> list[int]:
    ends = motion.avatar.hand.capsules[:, 1].tolist()
    return [ends.index(finger[-1]) for finger in motion.avatar.hand.fingers]


def _in_wrist(motion: AvatarMotion) -> Array:
    return transform(invert(motion.joints[:, 1])[:, None], motion.joints[..., :3])
