"""What is shown of a hand while its tracking comes and goes: live, hold, rest, and never a jump between them."""

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from manipnet.actors.output_guard import OutputGuard
from manipnet.geometry import Array, quat_conjugate, quat_exp, quat_log, quat_multiply

State = Literal["live", "hold", "rest"]

HOLD_AFTER_S: Final = 0.1
REST_AFTER_S: Final = 0.5
"""Without a tracked sample for this long, a body's hand is held, and then eases to the rest pose."""

RETURN_HALF_LIFE_S: Final = 0.06
"""Back to live: nine tenths of the way in 0.2 s."""
REST_HALF_LIFE_S: Final = 0.2

CLOSED: Final = 1e-6
"""A gap below a micrometre or a microradian is none."""

_TOLERANCE_S: Final = 1e-6


def state_at_age(age_s: float) -> State:
    """State of a hand whose tracking is `age_s` old; an age of infinity is a body never seen."""
    if age_s <= HOLD_AFTER_S + _TOLERANCE_S:
        return "live"
    return "hold" if age_s <= REST_AFTER_S + _TOLERANCE_S else "rest"


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """What one hand shows at one tick: `angles (20,)`, `wrist (7,)` in the world."""

    state: State
    angles: Array
    wrist: Array


class InertializationOffset:
    """The gap between what is shown and what should be: opened by a change of source, closed by a critically
    damped spring, so what is shown neither jumps nor overshoots."""

    def __init__(self, size: int) -> None:
        self.gap = np.zeros(size)
        self._speed = np.zeros(size)
        self._open = False

    def open(self, gap: Array) -> None:
        """Start from a new gap, at rest."""
        self.gap, self._speed, self._open = gap, np.zeros_like(gap), True

    def change(self, gap: Array) -> None:
        """Go on from another gap, closing it as fast as the one before."""
        self.gap, self._open = gap, True

    def close(self, dt_s: float, half_life_s: float) -> Array:
        """The gap `dt_s` later; `half_life_s` is about the time in which half of it closes."""
        if not self._open:
            return self.gap
        stiffness = 2.0 * math.log(2.0) / half_life_s
        pull = self._speed + stiffness * self.gap
        decay = math.exp(-stiffness * dt_s)
        self.gap = decay * (self.gap + pull * dt_s)
        self._speed = decay * (self._speed - stiffness * pull * dt_s)
        if np.abs(self.gap).max() < CLOSED:
            self.gap, self._speed, self._open = np.zeros_like(self.gap), np.zeros_like(self.gap), False
        return self.gap


class PoseTransition:
    """One hand as it is shown from tick to tick."""

    def __init__(self, rest_angles: Array, guard: OutputGuard) -> None:
        self._rest_angles, self._guard = rest_angles, guard
        self._fingers, self._wrist = InertializationOffset(len(rest_angles)), InertializationOffset(6)
        self._finger_source: Hashable = None
        self._wrist_source: Hashable = None
        self._guessed = False
        self.shown: Shown | None = None

    def show(
        self,
        state: State,
        angles: Array | None,
        wrist: Array | None,
        run: int,
        held: Hashable,
        dt_s: float,
        known: bool = True,
    ) -> Shown | None:
        """The hand at the next tick, `dt_s` after the last one.

        `angles (20,)` is the synthesised pose of a live hand; without it the fingers are held, or ease to rest.
        `wrist (7,)` is the tracked pose, None where it is lost: then the last one stays; `known` is False where it
        had to be guessed, because nothing newer has arrived. When the `run` of the stream or the object `held`
        changes, after a guess, and when the wrist is somewhere else at once, the hand glides from what it showed.
        None before a wrist was seen.
        Raises `NotFiniteError` and changes nothing.
        """
        self._guard.check(angles, wrist)
        source = (state, run, held)
        if self.shown is None:
            if wrist is None:
                return None
            self._finger_source, self._wrist_source = source, run
            self.shown = Shown(state, self._rest_angles if angles is None else self._guard.inside(angles), wrist)
        else:
            fingers = self._next_angles(self.shown.angles, state, angles, source, dt_s)
            self.shown = Shown(state, fingers, self._next_wrist(self.shown.wrist, wrist, run, dt_s))
        self._guessed = not known
        return self.shown

    def _next_angles(self, shown: Array, state: State, angles: Array | None, source: Hashable, dt_s: float) -> Array:
        if angles is None and state != "rest":
            self._finger_source = None
            return shown
        target = self._rest_angles if angles is None else angles
        if self._finger_source != source:
            self._finger_source = source
            self._fingers.open(shown - target)
        half_life_s = REST_HALF_LIFE_S if angles is None else RETURN_HALF_LIFE_S
        return self._guard.within(target + self._fingers.close(dt_s, half_life_s), shown, dt_s)

    def _next_wrist(self, shown: Array, wrist: Array | None, source: Hashable, dt_s: float) -> Array:
        if wrist is None:
            self._wrist_source = None
            return shown
        if self._wrist_source != source:
            self._wrist_source = source
            self._wrist.open(_gap(shown, wrist))
        elif self._guessed:
            self._wrist.change(_gap(shown, wrist))
        wanted = _beside(wrist, self._wrist.close(dt_s, RETURN_HALF_LIFE_S))
        if self._guard.is_reachable(*_apart(shown.tolist(), wanted.tolist()), dt_s):
            return wanted
        self._wrist.open(_gap(shown, wrist))
        return shown


def _apart(one: Sequence[float], other: Sequence[float]) -> tuple[float, float]:
    """How far two poses are from each other, metres and radians; NumPy would take ten times as long for two."""
    cosine = abs(one[3] * other[3] + one[4] * other[4] + one[5] * other[5] + one[6] * other[6])
    return math.dist(one[:3], other[:3]), 2.0 * math.acos(min(cosine, 1.0))


def _gap(shown: Array, wrist: Array) -> Array:
    """What lies between two poses `(7,)`: a way and a rotation vector `(6,)`, world frame."""
    turn = quat_log(quat_multiply(shown[3:], quat_conjugate(wrist[3:])))
    return np.concatenate([shown[:3] - wrist[:3], turn])


def _beside(wrist: Array, gap: Array) -> Array:
    """The pose that `gap` lies between it and `wrist`."""
    if not gap.any():
        return wrist
    return np.concatenate([wrist[:3] + gap[:3], quat_multiply(quat_exp(gap[3:]), wrist[3:])])
