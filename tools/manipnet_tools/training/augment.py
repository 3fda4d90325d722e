"""Poses to train on besides the captured ones: blended away, and reached by the model itself.

Whatever pose a tick starts from, the answer is the captured next pose plus what is left of the error after one tick
(`kept` of it): a hand that went astray is led back over a few ticks instead of being thrown back in one, which is
what made perturbed training jitter.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from manipnet.geometry import Array
from manipnet.synthesis.hand.hand import Hand
from manipnet_tools.training.dataset import TICK_FRAMES, HandTrack, Samples, concatenate, samples_at

Policy = Callable[[np.ndarray], Array]
"""From feature rows `(N, input_size)` to angles `(N, A)` inside the limits."""


def led_back(before: Array, captured_before: Array, captured: Array, kept: float) -> Array:
    """The answer `(N, A)` for a tick that starts at `before` while the captured hand was at `captured_before`."""
    return captured + kept * (before - captured_before)


def blended_poses(hand: Hand, captured: Array, pool: Array, rng: np.random.Generator) -> Array:
    """Each pose of `captured (N, A)` blended toward another of `pool`, as a whole or finger by finger."""
    count = len(captured)
    other = pool[rng.integers(len(pool), size=count)]
    whole = rng.random((count, 1)) ** 1.5
    shape = count, len(hand.fingers)
    fingers = (rng.random(shape) ** 1.5 * (rng.random(shape) < 0.5))[:, hand.finger_of_angle]
    blend = np.where(rng.random((count, 1)) < 0.5, whole, fingers)
    return captured + blend * (other - captured) + rng.normal(0.0, 0.02, captured.shape)


@dataclass(frozen=True)
class Lesson:
    """What the network is to answer."""

    kept: float
    """Share of a pose error that may remain after one tick."""
    lead_frames: float
    """How far ahead of the tick the answered pose is, captured frames: what the smoothing after the network lags."""
    response: float
    """Share of the way to the answer that a hand goes in one tick."""


def captured_samples(
    track: HandTrack, frames: np.ndarray, pool: Array | None, lesson: Lesson, limits: Array, rng: np.random.Generator,
    warp: float = 0.0,
) -> Samples:  # fmt: skip
    """Samples at `frames`, seen from the captured pose before or, with a `pool`, from poses blended toward it.

    `warp` plays time faster or slower by a factor up to `exp(±warp)`.
    """
    speed = np.exp(rng.uniform(-warp, warp, len(frames))) if warp else np.ones(len(frames))
    captured_before = track.angles_at(frames - TICK_FRAMES * speed)
    captured = track.angles_at(frames + lesson.lead_frames * speed)
    before = captured_before
    if pool is not None:
        before = np.clip(blended_poses(track.hand, captured_before, pool, rng), limits[:, 0], limits[:, 1])
    after = led_back(before, captured_before, captured, lesson.kept)
    return samples_at(track, frames, before, after, track.windows(frames, speed) if warp else None)


def self_made_samples(
    tracks: Sequence[HandTrack], spans: Sequence[tuple[int, int]], policy: Policy, starts: int, ticks: int,
    lesson: Lesson, pool: Array, limits: Array, rng: np.random.Generator,
) -> Samples:  # fmt: skip
    """Samples along roll-outs of the model from `starts` random poses per track, `ticks` long (Ross et al. 2011)."""
    frames = [rng.integers(low, high - TICK_FRAMES * ticks, starts) for low, high in spans]
    states = []
    for track, at in zip(tracks, frames, strict=True):
        before = track.angles_at(at - TICK_FRAMES)
        states.append(np.where(rng.random((starts, 1)) < 0.5, before, blended_poses(track.hand, before, pool, rng)))
    states = [np.clip(state, limits[:, 0], limits[:, 1]) for state in states]
    parts: list[Samples] = []
    for _ in range(ticks):
        step = [
            samples_at(
                t, at, s, led_back(s, t.angles_at(at - TICK_FRAMES), t.angles_at(at + lesson.lead_frames), lesson.kept)
            )
            for t, at, s in zip(tracks, frames, states, strict=True)
        ]
        parts += step
        answers = np.split(policy(np.concatenate([p.inputs for p in step])), len(tracks))
        states = [s + lesson.response * (a - s) for s, a in zip(states, answers, strict=True)]
        frames = [at + TICK_FRAMES for at in frames]
    return concatenate(parts)
