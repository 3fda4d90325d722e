"""Takes samples out of a frame that cannot be real: jumps, swapped identities, frozen poses, zeros.

A rejected body is passed on as not tracked, with the reason as its `fault`; the hands decide what to show for a lost
body. The timeline deals with time that goes backwards and with duplicate and late frames. No clock, no I/O.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from manipnet.wire.bodies import BodyFrame, BodySample

MAX_SPEED_M_S: Final = 20.0
MAX_SPIN_RAD_S: Final = 40.0
MARGIN_M: Final = 0.1
MARGIN_RAD: Final = 0.5
"""No hand, and nothing in a hand, moves faster than this by more than a margin for noise."""
CONFIRM_S: Final = 0.2
"""A jump is believed when the body has stayed where it jumped to for this long."""
FORGET_S: Final = 1.0
"""After this long without an accepted sample, or this far back in time, a body is accepted wherever it appears."""
SWAP_SPEED_M_S: Final = 4.0
SWAP_RATIO: Final = 0.25
"""Two bodies were swapped if both moved faster than this and each is now near the other's old place: nearer than this
share of the distance between the two places.
"""
NOISE_M: Final = (2e-6, 1e-3)
NOISE_TURNS: Final = 20
"""Noise reverses direction at most small steps; real motion does not. A body that has shown this many more small steps
back than forth along one axis has noise, so it can never be perfectly still. Smaller steps may be those of rounding.
"""
FROZEN_S: Final = 0.5
MOVING_S: Final = 0.1
"""A body is frozen if it has not changed for `FROZEN_S` while others of its sender did within `MOVING_S`."""
MAX_BODIES: Final = 1_024

Key = tuple[str, int | None, str | None]
Vector = tuple[float, float, float]


@dataclass(slots=True)
class _History:
    """The newest accepted sample of one body, the place it may have jumped to, and what is known of its noise."""

    t_s: float
    sample: BodySample
    jumped_s: float = 0.0
    candidate: tuple[float, BodySample] | None = None
    step: Vector = (0.0, 0.0, 0.0)
    noise_turns: list[int] = field(default_factory=lambda: [0, 0, 0])
    """By axis, how many more small steps were back than forth."""
    has_noise: bool = False
    changed_s: float = field(default=-math.inf)


class OutlierGate:
    """Judges the bodies of any number of senders, each by its own past. Not thread-safe."""

    def __init__(self) -> None:
        self._histories: dict[Key, _History] = {}
        self._moved_s: dict[str, float] = {}

    @property
    def known_bodies(self) -> int:
        """The number of bodies whose past is known, at most `MAX_BODIES`."""
        return len(self._histories)

    def check(self, frame: BodyFrame) -> tuple[BodyFrame, list[str]]:
        """The frame with impossible bodies made untracked, and the reasons, of `telemetry.BODY_REASONS`."""
        keys = [(frame.source, body.id, body.name) for body in frame.bodies]
        swapped = self._swapped(frame, keys)
        bodies = [
            self._judge(frame, key, body, body in swapped) if body.tracked else body
            for key, body in zip(keys, frame.bodies, strict=True)
        ]
        reasons = [body.fault for body in bodies if body.fault is not None]
        return (frame._replace(bodies=tuple(bodies)) if reasons else frame), reasons

    def _judge(self, frame: BodyFrame, key: Key, body: BodySample, swapped: bool) -> BodySample:
        history = self._histories.get(key)
        if history is None:
            if len(self._histories) >= MAX_BODIES:
                self._histories.clear()
                self._moved_s.clear()
            self._histories[key] = _History(frame.t_s, body, changed_s=frame.t_s)
            return body
        # If nothing moves, a recording has ended or is paused, and no single body is frozen.
        others_move = frame.t_s - self._moved_s.get(frame.source, frame.t_s) < MOVING_S
        fault = _fault(history, frame.t_s, body, swapped, others_move)
        if history.changed_s == frame.t_s:
            self._moved_s[frame.source] = frame.t_s
        return body if fault is None else body._replace(tracked=False, fault=fault)

    def _swapped(self, frame: BodyFrame, keys: Sequence[Key]) -> Sequence[BodySample]:
        """Bodies that exchanged their places in one step, as they do when a tracker confuses two of them."""
        fast: list[tuple[BodySample, Vector]] = []
        for key, body in zip(keys, frame.bodies, strict=True):
            history = self._histories.get(key) if body.tracked else None
            if history is None or not 0.0 < frame.t_s - history.t_s < CONFIRM_S:
                continue
            if math.dist(body.p, history.sample.p) > SWAP_SPEED_M_S * (frame.t_s - history.t_s):
                fast.append((body, history.sample.p))
        if len(fast) < 2:
            return ()
        return [
            one
            for one, p_one in fast
            for other, p_other in fast
            if other is not one
            and max(math.dist(one.p, p_other), math.dist(other.p, p_one)) < SWAP_RATIO * math.dist(p_one, p_other)
        ]


def _fault(history: _History, t_s: float, body: BodySample, swapped: bool, others_move: bool) -> str | None:
    """Why a tracked sample cannot be real, or None; updates the history."""
    elapsed_s = t_s - history.t_s
    if elapsed_s < -FORGET_S:
        _accept(history, t_s, body)
        return None
    if body.p == (0.0, 0.0, 0.0) and math.dist(body.p, history.sample.p) > MARGIN_M:
        return "zeros"
    if _is_still(history, t_s, body) and others_move:
        return "frozen"
    if elapsed_s > FORGET_S:
        _accept(history, t_s, body)
        return None
    if not swapped and _is_near(history.sample, body, abs(elapsed_s)) and _is_back(history, body):
        _accept(history, t_s, body)
        return None
    if history.candidate is None or not _is_near(history.candidate[1], body, abs(t_s - history.candidate[0])):
        history.jumped_s = t_s
    history.candidate = (t_s, body)
    if t_s - history.jumped_s < CONFIRM_S:
        return "swap" if swapped else "jump"
    _accept(history, t_s, body)
    return None


def _accept(history: _History, t_s: float, body: BodySample) -> None:
    if abs(t_s - history.t_s) > FORGET_S or t_s >= history.t_s:  # a late sample is accepted but is not the newest
        history.t_s, history.sample = t_s, body
    history.candidate = None


def _is_near(known: BodySample, body: BodySample, elapsed_s: float) -> bool:
    """Whether a body can have moved from a known sample to a new one within `elapsed_s`."""
    if math.dist(known.p, body.p) > MARGIN_M + MAX_SPEED_M_S * elapsed_s:
        return False
    return _angle(known, body) <= MARGIN_RAD + MAX_SPIN_RAD_S * elapsed_s


def _is_back(history: _History, body: BodySample) -> bool:
    """Whether a body that jumped is nearer to where it came from than to where it went."""
    return history.candidate is None or _distance_m(history.sample, body) < _distance_m(history.candidate[1], body)


def _is_still(history: _History, t_s: float, body: BodySample) -> bool:
    """Whether a body with noise has been bit-identical for long; learns the noise.

    A body without noise is computed, not tracked, such as a recorded prop on a table; it may be still.
    """
    if body.p == history.sample.p and body.q == history.sample.q:
        return history.has_noise and t_s - history.changed_s > FROZEN_S
    if not history.has_noise:
        _learn_noise(history, body)
    history.changed_s = t_s
    return False


def _learn_noise(history: _History, body: BodySample) -> None:
    (x, y, z), (known_x, known_y, known_z) = body.p, history.sample.p
    step, turns = (x - known_x, y - known_y, z - known_z), history.noise_turns
    for axis, (one, before) in enumerate(zip(step, history.step, strict=True)):
        if NOISE_M[0] < abs(one) < NOISE_M[1]:
            turns[axis] = turns[axis] + 1 if one * before < 0.0 else max(turns[axis] - 1, 0)
    history.has_noise = max(turns) >= NOISE_TURNS
    history.step = step


def _angle(one: BodySample, other: BodySample) -> float:
    (ax, ay, az, aw), (bx, by, bz, bw) = one.q, other.q  # a loop would take four times as long
    return 2.0 * math.acos(min(abs(ax * bx + ay * by + az * bz + aw * bw), 1.0))


def _distance_m(one: BodySample, other: BodySample) -> float:
    """Position and rotation in one measure: the rim of a body is about a decimetre from its centre."""
    return math.dist(one.p, other.p) + 0.1 * _angle(one, other)
