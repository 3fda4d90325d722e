"""Body by body, what a tracker claims and cannot be: jumps, swapped identities, frozen poses, zeros.

A rejected body is handed on as not tracked, with the reason as its `fault`; what to show for a lost body is not
decided here. Time that goes backwards, doubled and late frames are the timeline's. No clock, no I/O.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from manipnet.wire.bodies import BodyFrame, BodySample

MAX_SPEED_M_S = 20.0
MAX_SPIN_RAD_S = 40.0
MARGIN_M = 0.1
MARGIN_RAD = 0.5
"""Faster than this, beyond a margin for noise, is no hand and nothing in one."""
CONFIRM_S = 0.2
"""A body that stays where it jumped to this long is believed to be there."""
FORGET_S = 1.0
"""After so long without an accepted sample, or so far back in time, a body is taken where it appears."""
SWAP_SPEED_M_S = 4.0
SWAP_RATIO = 0.25
"""Two bodies faster than this, each this near to where the other was (of the way they made), have swapped."""
NOISE_M = 1e-3
NOISE_TURNS = 20
"""Noise turns back at most of its small steps, which motion never does: a tracker whose body has shown so many more
small steps back than on has noise, and then it never stands still."""
FROZEN_S = 0.5
MOVING_S = 0.1
"""A body is frozen that has not changed for `FROZEN_S` while others of its sender did within `MOVING_S`."""
MAX_BODIES_KNOWN = 1_024

Key = tuple[str, int | None, str | None]
Vector = tuple[float, float, float]


@dataclass(slots=True)
class _Memory:
    """The newest accepted sample of one body, where it may have jumped to, and what is known of its noise."""

    t_s: float
    sample: BodySample
    jumped_s: float = 0.0
    candidate: tuple[float, BodySample] | None = None
    step: Vector = (0.0, 0.0, 0.0)
    noise_turns: int = 0
    changed_s: float = field(default=-math.inf)


class OutlierGate:
    """Judges the bodies of any number of senders, each in the light of its own past. Not thread-safe."""

    def __init__(self) -> None:
        self._memories: dict[Key, _Memory] = {}
        self._moved_s: dict[str, float] = {}

    def check(self, frame: BodyFrame) -> tuple[BodyFrame, list[str]]:
        """The frame with impossible bodies made untracked, and why (of `telemetry.BODY_REASONS`)."""
        swapped = self._swapped(frame)
        bodies = [self._judge(frame, body, body in swapped) for body in frame.bodies]
        reasons = [body.fault for body in bodies if body.fault is not None]
        return (replace(frame, bodies=tuple(bodies)) if reasons else frame), reasons

    def _judge(self, frame: BodyFrame, body: BodySample, swapped: bool) -> BodySample:
        if not body.tracked:
            return body
        key = _key(frame, body)
        memory = self._memories.get(key)
        if memory is None:
            if len(self._memories) >= MAX_BODIES_KNOWN:
                self._memories.clear()
                self._moved_s.clear()
            self._memories[key] = _Memory(frame.t_s, body, changed_s=frame.t_s)
            return body
        # Where nothing moves, a recording has ended or is paused: no single body was lost.
        others_move = frame.t_s - self._moved_s.get(frame.source, frame.t_s) < MOVING_S
        fault = _fault(memory, frame.t_s, body, swapped, others_move)
        if memory.changed_s == frame.t_s:
            self._moved_s[frame.source] = frame.t_s
        return body if fault is None else replace(body, tracked=False, fault=fault)

    def _swapped(self, frame: BodyFrame) -> Sequence[BodySample]:
        """Bodies that exchanged their places in one step, as trackers do when they confuse two."""
        fast: list[tuple[BodySample, Vector]] = []
        for body in frame.bodies:
            memory = self._memories.get(_key(frame, body)) if body.tracked else None
            if memory is None or not 0.0 < frame.t_s - memory.t_s < CONFIRM_S:
                continue
            if math.dist(body.p, memory.sample.p) > SWAP_SPEED_M_S * (frame.t_s - memory.t_s):
                fast.append((body, memory.sample.p))
        return [
            one
            for one, p_one in fast
            for other, p_other in fast
            if other is not one
            and max(math.dist(one.p, p_other), math.dist(other.p, p_one)) < SWAP_RATIO * math.dist(p_one, p_other)
        ]


def _fault(memory: _Memory, t_s: float, body: BodySample, swapped: bool, others_move: bool) -> str | None:
    """Why a tracked sample cannot be, or None; updates the memory."""
    elapsed_s = t_s - memory.t_s
    if elapsed_s < -FORGET_S:
        _accept(memory, t_s, body)
        return None
    if body.p == (0.0, 0.0, 0.0) and math.dist(body.p, memory.sample.p) > MARGIN_M:
        return "zeros"
    if _stands_still(memory, t_s, body) and others_move:
        return "frozen"
    if elapsed_s > FORGET_S:
        _accept(memory, t_s, body)
        return None
    if not swapped and _is_near(memory.sample, body, abs(elapsed_s)) and _is_back(memory, body):
        _accept(memory, t_s, body)
        return None
    if memory.candidate is None or not _is_near(memory.candidate[1], body, abs(t_s - memory.candidate[0])):
        memory.jumped_s = t_s
    memory.candidate = (t_s, body)
    if t_s - memory.jumped_s < CONFIRM_S:
        return "swap" if swapped else "jump"
    _accept(memory, t_s, body)
    return None


def _accept(memory: _Memory, t_s: float, body: BodySample) -> None:
    if abs(t_s - memory.t_s) > FORGET_S or t_s >= memory.t_s:  # a late sample is good but not the newest
        memory.t_s, memory.sample = t_s, body
    memory.candidate = None


def _is_near(known: BodySample, body: BodySample, elapsed_s: float) -> bool:
    if math.dist(known.p, body.p) > MARGIN_M + MAX_SPEED_M_S * elapsed_s:
        return False
    return _angle(known, body) <= MARGIN_RAD + MAX_SPIN_RAD_S * elapsed_s


def _is_back(memory: _Memory, body: BodySample) -> bool:
    """Whether a body that jumped is nearer to where it came from than to where it went."""
    return memory.candidate is None or _way(memory.sample, body) < _way(memory.candidate[1], body)


def _stands_still(memory: _Memory, t_s: float, body: BodySample) -> bool:
    """Whether a body whose tracker has noise has not changed by a bit for long; learns the noise.

    A body without noise is computed, not tracked (a recording's prop that lies on a table): it may stand still.
    """
    if body.p == memory.sample.p and body.q == memory.sample.q:
        return memory.noise_turns >= NOISE_TURNS and t_s - memory.changed_s > FROZEN_S
    step = (
        body.p[0] - memory.sample.p[0],
        body.p[1] - memory.sample.p[1],
        body.p[2] - memory.sample.p[2],
    )
    turned = sum(a * b for a, b in zip(step, memory.step, strict=True)) < 0.0
    if memory.noise_turns < NOISE_TURNS and math.hypot(*step) < NOISE_M:
        memory.noise_turns = memory.noise_turns + 1 if turned else max(memory.noise_turns - 1, 0)
    memory.step, memory.changed_s = step, t_s
    return False


def _angle(one: BodySample, other: BodySample) -> float:
    cosine = abs(sum(a * b for a, b in zip(one.q, other.q, strict=True)))
    return 2.0 * math.acos(min(cosine, 1.0))


def _way(one: BodySample, other: BodySample) -> float:
    """Position and rotation in one measure, metres: a body is about a decimetre from its centre to its rim."""
    return math.dist(one.p, other.p) + 0.1 * _angle(one, other)


def _key(frame: BodyFrame, body: BodySample) -> Key:
    return frame.source, body.id, body.name
