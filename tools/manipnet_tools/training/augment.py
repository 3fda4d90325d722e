"""Further poses to train on: captured poses that are blended with others, and poses that the model itself reaches.

Whatever pose a tick starts from, the answer is the captured next pose plus the part of the error that may remain after
one tick (`residual_error`). A hand that has drifted away then returns over a few ticks. Earlier models had to
return within one tick, which made them jitter.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from manipnet.geometry import Array, compose, quat_exp
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.model.decode import angles_from_outputs
from manipnet.synthesis.model.features import Windows
from manipnet.synthesis.model.layout import WINDOW_OFFSETS_S
from manipnet_tools.training.dataset import TICK_FRAMES, CapturedHand, Samples, concatenate, samples_at

SLIDE_M_S, TURN_RAD_S = 0.06, 0.5
"""How fast an object moves in a hand, along and about each axis, one standard deviation."""
Policy = Callable[[np.ndarray], Array]
"""Maps feature rows `(N, input_size)` to network outputs `(N, output_size)`."""


@dataclass(frozen=True)
class AnswerRule:
    """Which pose the network should answer with."""

    residual_error: float
    """Share of a pose error that may remain after one tick."""
    lead_frames: float
    """By how many captured frames the answer leads the tick, to compensate for the smoothing after the network."""
    response: float
    """Share of the way to the answer that a hand moves in one tick."""


def answer(before: Array, captured_before: Array, captured: Array, residual_error: float) -> Array:
    """The answer `(N, A)` for a tick that starts at `before` while the captured hand was at `captured_before`."""
    return captured + residual_error * (before - captured_before)


def blended_poses(hand: Hand, captured: Array, pool: Array, rng: np.random.Generator) -> Array:
    """Each pose of `captured (N, A)` blended toward another of `pool`, as a whole or finger by finger."""
    count = len(captured)
    other = pool[rng.integers(len(pool), size=count)]
    whole = rng.random((count, 1)) ** 1.5
    shape = count, len(hand.fingers)
    fingers = (rng.random(shape) ** 1.5 * (rng.random(shape) < 0.5))[:, hand.finger_of_angle]
    blend = np.where(rng.random((count, 1)) < 0.5, whole, fingers)
    return captured + blend * (other - captured) + rng.normal(0.0, 0.02, captured.shape)


def drawn_slides(count: int, share: float, rng: np.random.Generator) -> Array:
    """Velocities `(count, 2, 6)` of objects that move in the hand, before and after the present: metres and radians per
    second along and about each axis of the object. They are zero for all but this share."""
    if not share:
        return np.zeros((count, 2, 6))
    moving = rng.random((count, 1, 1)) < share
    return moving * rng.normal(0.0, [*3 * (SLIDE_M_S,), *3 * (TURN_RAD_S,)], (count, 2, 6))


def with_slides(windows: Windows, slides: Array) -> Windows:
    """The same windows, but the objects move at the velocities `slides (N, 2, 6)` too; at present all is where it was.

    Generated hands keep to their grasps, so that any motion of an object in a hand would mean that the hand reaches or
    lets go. A person also turns and pushes an object in the hand.
    """
    if not slides.any():
        return windows
    past, future = np.minimum(WINDOW_OFFSETS_S, 0.0), np.maximum(WINDOW_OFFSETS_S, 0.0)
    moved = past[:, None] * slides[:, :1] + future[:, None] * slides[:, 1:]
    motion = np.concatenate([moved[..., :3], quat_exp(moved[..., 3:])], axis=-1)
    return windows._replace(object=compose(windows.object, motion))


def captured_samples(
    captured: CapturedHand,
    frames: np.ndarray,
    pool: Array | None,
    rule: AnswerRule,
    limits: Array,
    rng: np.random.Generator,
    warp: float = 0.0,
    sliding: float = 0.0,
) -> Samples:
    """Samples at `frames`, seen from the captured pose before or, with a `pool`, from poses blended toward it.

    `warp` plays time faster or slower by a factor up to `exp(±warp)`; in a share `sliding` of the samples, the object
    moves in the hand.
    """
    speed = np.exp(rng.uniform(-warp, warp, len(frames))) if warp else np.ones(len(frames))
    captured_before = captured.angles_at(frames - TICK_FRAMES * speed)
    captured_next = captured.angles_at(frames + rule.lead_frames * speed)
    before = captured_before
    if pool is not None:
        before = np.clip(blended_poses(captured.hand, captured_before, pool, rng), limits[:, 0], limits[:, 1])
    after = answer(before, captured_before, captured_next, rule.residual_error)
    windows = with_slides(captured.windows(frames, speed), drawn_slides(len(frames), sliding, rng))
    return samples_at(captured, frames, before, after, windows)


def on_policy_samples(
    hands: Sequence[CapturedHand],
    spans: Sequence[tuple[int, int]],
    policy: Policy,
    starts: Sequence[int],
    ticks: int,
    rule: AnswerRule,
    pool: Array,
    limits: Array,
    rng: np.random.Generator,
    sliding: float = 0.0,
) -> Samples:
    """Samples along roll-outs of the model, `ticks` long, from random poses: `starts` of them for each hand.

    The answers of the network are decoded with the hand of each take, which need not be the model's.

    Source: Ross, Gordon and Bagnell 2011 (DAgger).
    """
    frames = [rng.integers(low, high - TICK_FRAMES * ticks, n) for (low, high), n in zip(spans, starts, strict=True)]
    states = []
    for captured, at in zip(hands, frames, strict=True):
        before = captured.angles_at(at - TICK_FRAMES)
        as_captured = rng.random((len(at), 1)) < 0.5
        states.append(np.where(as_captured, before, blended_poses(captured.hand, before, pool, rng)))
    states = [np.clip(state, limits[:, 0], limits[:, 1]) for state in states]
    slides = [drawn_slides(n, sliding, rng) for n in starts]
    parts: list[Samples] = []
    ends = np.cumsum(starts)[:-1]
    for _ in range(ticks):
        tick = [_tick_samples(*each, rule) for each in zip(hands, frames, states, slides, strict=True)]
        parts += tick
        outputs = np.split(policy(np.concatenate([samples.inputs for samples in tick])), ends)
        answers = [angles_from_outputs(c.hand, o, limits) for c, o in zip(hands, outputs, strict=True)]
        states = [s + rule.response * (a - s) for s, a in zip(states, answers, strict=True)]
        frames = [at + TICK_FRAMES for at in frames]
    return concatenate(parts)


def _tick_samples(captured: CapturedHand, frames: np.ndarray, state: Array, slides: Array, rule: AnswerRule) -> Samples:
    before, after = captured.angles_at(frames - TICK_FRAMES), captured.angles_at(frames + rule.lead_frames)
    windows = with_slides(captured.windows(frames), slides)
    return samples_at(captured, frames, state, answer(state, before, after, rule.residual_error), windows)
