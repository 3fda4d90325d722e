"""What is shown of a hand while its tracking comes and goes: live, held or at rest, without a jump in between.

Inertialization (Bollo 2018, "Inertialization: High-Performance Animation Transitions in Gears of War") hides a change
of source: the pose that is shown is the new source plus an offset, which starts as the gap and decays to zero.
"""

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from manipnet.actors.output_guard import OutputGuard
from manipnet.geometry import Array, quat_conjugate, quat_exp, quat_log, quat_multiply
from manipnet.wire import State

HOLD_AFTER_S: Final = 0.1
REST_AFTER_S: Final = 0.5
"""After this long without a tracked sample a hand is held, and then eases to the rest pose."""

RETURN_HALF_LIFE_S: Final = 0.06
"""For a return to live: nine tenths of the gap are closed within 0.2 s."""
REST_HALF_LIFE_S: Final = 0.2

CLOSED: Final = 1e-6
"""Offsets below a micrometre or a microradian count as closed."""

_TOLERANCE_S: Final = 1e-6


def state_at_age(age_s: float) -> State:
    """State of a hand whose tracking is `age_s` old; an age of infinity means a body that was never tracked."""
    if age_s <= HOLD_AFTER_S + _TOLERANCE_S:
        return "live"
    return "hold" if age_s <= REST_AFTER_S + _TOLERANCE_S else "rest"


@dataclass(frozen=True, slots=True, eq=False)
class ShownHand:
    """One hand as it is shown at one tick: `angles (20,)` rad, `wrist (7,)` in the world, and the prop it is at."""

    state: State
    angles: Array
    wrist: Array
    prop: str | None


class InertializationOffset:
    """The offset of what is shown from its source, which a critically damped spring closes without overshoot."""

    def __init__(self, size: int) -> None:
        self.offset = np.zeros(size)
        self.is_open = False
        """Whether the offset is not zero yet."""
        self._speed = np.zeros(size)

    def open(self, offset: Array) -> None:
        """Start from a new offset, at rest."""
        self.offset, self._speed, self.is_open = offset, np.zeros_like(offset), True

    def change(self, offset: Array) -> None:
        """Replace the offset and keep its speed."""
        self.offset, self.is_open = offset, True

    def close(self, dt_s: float, half_life_s: float) -> Array:
        """The offset `dt_s` later; about half of it closes within `half_life_s`."""
        if not self.is_open:
            return self.offset
        stiffness = 2.0 * math.log(2.0) / half_life_s
        pull = self._speed + stiffness * self.offset
        decay = math.exp(-stiffness * dt_s)
        self.offset = decay * (self.offset + pull * dt_s)
        self._speed = decay * (self._speed - stiffness * pull * dt_s)
        if np.abs(self.offset).max() < CLOSED:
            self.offset, self._speed, self.is_open = np.zeros_like(self.offset), np.zeros_like(self.offset), False
        return self.offset


class PoseTransition:
    """Shows one hand from tick to tick and hides every change of source."""

    def __init__(self, rest_angles: Array, guard: OutputGuard) -> None:
        """`rest_angles (20,)` are in radians."""
        self._rest_angles, self._guard = rest_angles, guard
        self._fingers, self._wrist = InertializationOffset(len(rest_angles)), InertializationOffset(6)
        self._finger_source: Hashable = None
        self._wrist_source: Hashable = None
        self._was_forecast = False
        self.shown: ShownHand | None = None

    def show(
        self,
        state: State,
        angles: Array | None,
        wrist: Array | None,
        run: int,
        prop: str | None,
        dt_s: float,
        known: bool = True,
    ) -> ShownHand | None:
        """The hand at the next tick, `dt_s` after the last one; None before its wrist was tracked.

        `angles (20,)` is the synthesised pose of a live hand; without it the fingers are held, or ease to rest.
        `wrist (7,)` is the tracked pose; None stands for a lost wrist, which stays where it was. `known` is False if
        the wrist had to be forecast, because nothing newer has arrived. The hand glides from what it showed when the
        `run` of the stream or the `prop` changes, after a forecast, and when the wrist is suddenly somewhere else.
        Raises `NotFiniteError`, and then changes nothing.
        """
        self._guard.check(angles, wrist)
        source = (state, run, prop)
        if self.shown is None:
            if wrist is None:
                return None
            self._finger_source, self._wrist_source = source, run
            fingers = self._rest_angles if angles is None else self._guard.inside(angles)
            self.shown = ShownHand(state, fingers, wrist, prop)
        else:
            fingers = self._next_angles(self.shown.angles, state, angles, source, dt_s)
            self.shown = ShownHand(state, fingers, self._next_wrist(self.shown.wrist, wrist, run, dt_s), prop)
        self._was_forecast = not known
        return self.shown

    def _next_angles(self, shown: Array, state: State, angles: Array | None, source: Hashable, dt_s: float) -> Array:
        if angles is None and state != "rest":
            self._finger_source = None
            return shown
        target = self._rest_angles if angles is None else angles
        if self._finger_source != source:
            self._finger_source = source
            self._fingers.open(shown - target)
        if self._fingers.is_open:
            target = target + self._fingers.close(dt_s, REST_HALF_LIFE_S if angles is None else RETURN_HALF_LIFE_S)
        return self._guard.within(target, shown, dt_s)

    def _next_wrist(self, shown: Array, wrist: Array | None, source: Hashable, dt_s: float) -> Array:
        if wrist is None:
            self._wrist_source = None
            return shown
        if self._wrist_source != source:
            self._wrist_source = source
            self._wrist.open(_gap(shown, wrist))
        elif self._was_forecast:
            self._wrist.change(_gap(shown, wrist))
        wanted = wrist
        if self._wrist.is_open:
            wanted = _displaced(wrist, self._wrist.close(dt_s, RETURN_HALF_LIFE_S))
        if self._guard.is_reachable(*_distance(shown.tolist(), wanted.tolist()), dt_s):
            return wanted
        self._wrist.open(_gap(shown, wrist))
        return shown


def _distance(one: Sequence[float], other: Sequence[float]) -> tuple[float, float]:
    """Distance of two poses in metres and radians; NumPy would take ten times as long for two."""
    cosine = abs(one[3] * other[3] + one[4] * other[4] + one[5] * other[5] + one[6] * other[6])
    return math.dist(one[:3], other[:3]), 2.0 * math.acos(min(cosine, 1.0))


def _gap(shown: Array, wrist: Array) -> Array:
    """The offset `(6,)` of the pose `shown (7,)` from `wrist (7,)`: a displacement and a rotation vector, in the world
    frame.
    """
    turn = quat_log(quat_multiply(shown[3:], quat_conjugate(wrist[3:])))
    return np.concatenate([shown[:3] - wrist[:3], turn])


def _displaced(wrist: Array, gap: Array) -> Array:
    """The pose `(7,)` whose offset from `wrist` is `gap (6,)`."""
    if not gap.any():
        return wrist
    return np.concatenate([wrist[:3] + gap[:3], quat_multiply(quat_exp(gap[3:]), wrist[3:])])
