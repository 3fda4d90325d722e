"""How good a roll-out is: pure functions over arrays at 60 Hz.

The measures follow the paper (section 8) where it defines them; near frames, the joint error ratio, contact
F1 and the idle hand are this project's. Positions are metres, joints in the order of the hand; "wrist
frame" means the canonical right hand's, so a left hand is mirrored before it comes here. A *gap* is the
distance from a capsule's surface to the object's surface, negative inside.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from manipnet import geometry
from manipnet.geometry import Array
from manipnet.synthesis.hand.hand import Hand

Mask = NDArray[np.bool_]

RATE_HZ = 60.0
SETTLE_FRAMES = 60
"""The first second after the neutral start, which no measure counts."""

NEAR_M, IDLE_M, CONTACT_M = 0.03, 0.15, 0.005
DEEP_M, SHARE_M, DRIFT_M = 0.015, 0.01, 0.03
TOUCH_M = 0.004
AXIS_SAMPLES = 7
PALM_START = 0.3
"""Palm capsules are sampled from 30 % of the way from wrist to knuckle: the rest is forearm side."""


class Surface(Protocol):
    """What the measures need of an object: `manipnet.synthesis.objects.shape.Shape` has it."""

    def signed_distance(self, points: Array) -> tuple[Array, Array, Array]:
        """Points `(n, 3)` to distance `(n,)` negative inside, outward normal and closest point `(n, 3)`."""
        ...


@dataclass(frozen=True)
class Gaps:
    """Where each capsule is nearest the object: gap `(T, 19)`, surface point and outward normal `(T, 19, 3)`.

    Points and normals are in the object's frame.
    """

    gap: Array
    point: Array
    normal: Array

    def __getitem__(self, frames: slice | Mask) -> "Gaps":
        return Gaps(self.gap[frames], self.point[frames], self.normal[frames])

    @property
    def closest(self) -> Array:
        """Smallest gap of the hand at each frame, `(T,)`."""
        return self.gap.min(axis=1)


def capsule_axes(hand: Hand, positions: Array) -> Array:
    """Seven points along the axis of each capsule: joints `(..., J, 3)` to `(..., C, 7, 3)`."""
    first, last = hand.capsules.T
    fractions = np.linspace(np.where(first == 0, PALM_START, 0.0), 1.0, AXIS_SAMPLES, axis=1)
    start, end = positions[..., first, None, :], positions[..., last, None, :]
    return start + fractions[:, :, None] * (end - start)


def capsule_gaps(hand: Hand, p_world: Array, T_world_object: Array, surface: Surface) -> Gaps:
    """Gaps between the capsules of a hand and an object.

    `p_world (T, J, 3)` are joint positions, `T_world_object (T, 7)` the pose of the mesh frame.
    """
    p_object = geometry.transform(geometry.invert(T_world_object)[:, None, None], capsule_axes(hand, p_world))
    distance, normal, point = surface.signed_distance(p_object.reshape(-1, 3))
    distance = distance.reshape(p_object.shape[:3])
    nearest = distance.argmin(axis=2)[..., None]

    def pick(values: Array) -> Array:
        return np.take_along_axis(values.reshape(p_object.shape), nearest[..., None], axis=2)[:, :, 0]

    gap = np.take_along_axis(distance, nearest, axis=2)[..., 0] - hand.radii
    return Gaps(gap, pick(point), pick(normal))


def settled(frames: int) -> Mask:
    """Frames of a roll-out that count, `(frames,)`."""
    return np.arange(frames) >= SETTLE_FRAMES


def near(captured: Gaps) -> Mask:
    """Frames where the captured hand's closest capsule is within 3 cm of the object, `(T,)`."""
    return captured.closest < NEAR_M


def idle(captured: Gaps) -> Mask:
    """Frames where the captured hand is further than 15 cm from the object, `(T,)`."""
    return captured.closest > IDLE_M


def joint_error_m(positions: Array, captured: Array) -> Array:
    """Mean distance of the 21 joints beyond the wrist, wrist frame: `(T, 22, 3)` twice to `(T,)`."""
    return np.linalg.norm(positions - captured, axis=-1)[:, 1:].mean(axis=1)


def fingertip_error_m(hand: Hand, positions: Array, captured: Array) -> Array:
    """Mean distance of the five fingertips, wrist frame: `(T, 22, 3)` twice to `(T,)`."""
    return np.linalg.norm(positions - captured, axis=-1)[:, hand.bone_count :].mean(axis=1)


def penetration_cm(gaps: Gaps) -> float:
    """Depth into the object, mean over all frames and capsules."""
    return 100.0 * float(np.maximum(-gaps.gap, 0.0).mean())


def deeper_share(gaps: Gaps, depth_m: float = SHARE_M) -> float:
    """Share of capsules, over all frames, that are deeper in the object than `depth_m`."""
    return float((gaps.gap < -depth_m).mean())


def deep_frames(gaps: Gaps) -> float:
    """Share of frames with any capsule 1.5 cm deep or more: the paper's bound of a physical pose."""
    return float((gaps.closest < -DEEP_M).mean())


def contact_f1(gaps: Gaps, captured: Gaps) -> float:
    """F1 of capsules within 5 mm of the surface against the captured hand's; nan where none touches."""
    ours, theirs = gaps.gap < CONTACT_M, captured.gap < CONTACT_M
    total = ours.sum() + theirs.sum()
    return float(2.0 * (ours & theirs).sum() / total) if total else float("nan")


def slide_mm_s(hand: Hand, p_object: Array, gaps: Gaps) -> float:
    """Mean speed over the object's surface of fingertips whose capsules touch it (4 mm) in two frames on end.

    `p_object (T, 22, 3)` are joint positions in the object's frame; nan where none touches.
    """
    tips = np.flatnonzero(hand.capsules[:, 1] >= hand.bone_count)
    touching = gaps.gap[:, tips] < TOUCH_M
    speed = np.linalg.norm(np.diff(p_object[:, hand.capsules[tips, 1]], axis=0), axis=-1) * RATE_HZ
    held = speed[touching[1:] & touching[:-1]]
    return 1000.0 * float(held.mean()) if len(held) else float("nan")


def smoothness_cm_s2(positions: Array, frames: Mask | None = None) -> float:
    """Mean acceleration of the 22 joints in the wrist frame, by second differences of `(T, 22, 3)`.

    With `frames (T,)`, only where a frame and both its neighbours are in the mask; nan where none is.
    """
    acceleration = np.linalg.norm(np.diff(positions, 2, axis=0), axis=-1) * RATE_HZ**2
    if frames is not None:
        acceleration = acceleration[frames[:-2] & frames[1:-1] & frames[2:]]
    return 100.0 * float(acceleration.mean()) if len(acceleration) else float("nan")


def longest_drift_s(error_m: Array, threshold_m: float = DRIFT_M) -> float:
    """Longest time the joint error `(T,)` stays above 3 cm without a break."""
    above = np.concatenate([[False], error_m > threshold_m, [False]])
    edges = np.flatnonzero(np.diff(above))
    return float((edges[1::2] - edges[::2]).max(initial=0)) / RATE_HZ
