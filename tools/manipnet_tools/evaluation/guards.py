"""Measures that are wrong on both sides of the captured fingers' value, so that no excess of one kind can win.

Positions `(T, J, 3)` are in the canonical wrist frame, 60 frames a second, in metres.
"""

from dataclasses import dataclass

import numpy as np

from manipnet.geometry import Array
from manipnet.synthesis.hand.hand import Hand
from manipnet.tracking.tick import TICK_HZ
from manipnet_tools.evaluation import metrics
from manipnet_tools.evaluation.metrics import Gaps, Mask

APPROACH_FRAMES = 60
"""The hand opens within the last second before it touches."""


def touching_capsules(gaps: Gaps, held: Mask) -> float:
    """Mean number of capsules within 4 mm of the surface in the frames `held (T,)`; nan without such frames."""
    return float((gaps.gap[held] < metrics.TOUCH_M).sum(axis=1).mean()) if held.any() else float("nan")


def aperture_m(hand: Hand, positions: Array) -> Array:
    """Mean distance of the thumb's tip from the other tips, `(T,)`."""
    thumb, *others = (finger[-1] for finger in hand.fingers)
    return np.linalg.norm(positions[:, others] - positions[:, [thumb]], axis=2).mean(axis=1)


@dataclass(frozen=True)
class Opening:
    """The widest aperture before contact, mean over contacts: how wide, and how long before. Both nan without one."""

    peak_m: float
    before_s: float


def opening(hand: Hand, positions: Array, captured: Gaps) -> Opening:
    """The peak aperture in the second before each contact of the captured hand, if it touched nothing for that long."""
    touches = captured.closest < metrics.CONTACT_M
    onsets = [
        k for k in range(APPROACH_FRAMES, len(touches)) if touches[k] and not touches[k - APPROACH_FRAMES : k].any()
    ]
    if not onsets:
        return Opening(float("nan"), float("nan"))
    aperture = aperture_m(hand, positions)
    approaches = np.stack([aperture[k - APPROACH_FRAMES : k + 1] for k in onsets])
    before = APPROACH_FRAMES - approaches.argmax(axis=1)
    return Opening(float(approaches.max(axis=1).mean()), float(before.mean()) / TICK_HZ)


def energy_m2_s2(positions: Array, frames: Mask) -> float:
    """Mean squared speed of the joints over the steps that start and end in `frames (T,)`; nan without such steps."""
    velocity = np.diff(positions, axis=0) * TICK_HZ
    steps = frames[1:] & frames[:-1]
    return float((velocity[steps] ** 2).sum(axis=2).mean()) if steps.any() else float("nan")


def self_overlap_m(hand: Hand, positions: Array) -> Array:
    """How deep the capsules of two different fingers overlap at most in each frame, `(T,)`; 0 if none do."""
    first, second = finger_pairs(hand)
    starts, ends = positions[:, hand.capsules[:, 0]], positions[:, hand.capsules[:, 1]]
    distance = segment_distance(starts[:, first], ends[:, first], starts[:, second], ends[:, second])
    return np.maximum(hand.radii[first] + hand.radii[second] - distance, 0.0).max(axis=1)


def finger_pairs(hand: Hand) -> tuple[np.ndarray, np.ndarray]:
    """All pairs of finger capsules that belong to different fingers; the capsules of the palm are left out."""
    owner = np.full(len(hand.capsules), -1)
    for finger, joints in enumerate(hand.fingers):
        owner[np.isin(hand.capsules, joints).all(axis=1)] = finger
    pairs = np.array(np.triu_indices(len(owner), 1))
    one, other = owner[pairs]
    first, second = pairs[:, (one >= 0) & (other >= 0) & (one != other)]
    return first, second


def segment_distance(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Shortest distance of the segments from `a` to `b` and from `c` to `d`, all `(..., 3)`.

    Source: Ericson, Real-Time Collision Detection, 5.1.9.
    """
    u, v, w = b - a, d - c, a - c
    uu, uv, vv = (u * u).sum(-1), (u * v).sum(-1), (v * v).sum(-1)
    uw, vw = (u * w).sum(-1), (v * w).sum(-1)
    s = np.clip((uv * vw - uw * vv) / np.maximum(uu * vv - uv * uv, 1e-15), 0.0, 1.0)
    t = np.clip((uv * s + vw) / vv, 0.0, 1.0)
    s = np.clip((uv * t - uw) / uu, 0.0, 1.0)
    return np.linalg.norm(w + s[..., None] * u - t[..., None] * v, axis=-1)
