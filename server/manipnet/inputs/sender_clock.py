"""Judges the clocks of one sender, and chooses the one from which its frames take their times.

A sender may state the time of a frame in several ways, and some of them are not clocks: a constant, whole seconds, or a
number in another unit. A clock is believed at first, and is set aside once it has proved not to run; it is judged again
all the time. What the arrivals tell is used when no clock runs. Reads no clock: arrival times are arguments.
"""

import math
from collections import deque
from collections.abc import Iterable
from typing import Final

PLAUSIBLE: Final = (0.1, 10.0)
"""Seconds of a sender's clock per second of ours. A replay may be slow or fast; a wrong unit makes a factor of 60 or
more."""
STEP_S: Final = 1e-4
"""A clock that advances by less than this from one frame to the next stands still."""
MOVING_SHARE: Final = 0.6
"""The share of the frames at which a clock must step. A clock of coarse steps is the same at the others."""
JUMP_S: Final = 0.5
"""A clock that steps by this much more or less than ours was set, wrapped around, or has another unit."""
MUCH_TOO_SLOW: Final = 0.02
"""A clock that is not known yet is set aside at once if it is as slow as this."""
WINDOW_S: Final = 0.25
STILL_FRAMES: Final = 4
STILL_S: Final = 0.02
"""So many frames over so long a time with the same time stamp prove that a clock stands still."""
DATAGRAM_S: Final = 0.002
"""The same time within this is a frame in several datagrams."""
AHEAD_S: Final = 0.1
"""How far frames that arrive in a bunch may be moved into the future of the newest arrival."""
FORGOTTEN_FRAMES: Final = 30
"""A clock that was no longer stated must be stated so often in a row before it is used again."""
ARRIVAL: Final = "arrival"
"""The name of the clock that is used when no other runs."""
_RATE_FRAMES: Final = 32
_STILL: Final = "stands still"


class Clock:
    """One way in which a sender states times. `runs` is None until that is known."""

    def __init__(self, name: str, place: int, plausible: tuple[float, float]) -> None:
        """`place` is its place among the clocks of its sender."""
        self.name, self.place = name, place
        self.runs: bool | None = None
        self.doubtful = False
        """Whether the first value does not look like a time of a running clock."""
        self.fault = ""
        """Why it was set aside, as the end of a sentence that begins with its name."""
        self._plausible = plausible
        self.streak = 0
        """How many frames in a row have stated it."""
        self.needs = 1
        """How many frames in a row must have stated it before it may be used."""
        self._last_s = self._noted_s = self._begun_s = self._begun_at_s = self._still_since_s = 0.0
        self._noted = False
        self._frames = self._steps = self._still = self._jumps = self._bad = self._good = 0

    def note(self, t_s: float, now_s: float) -> None:
        """Take the time that a frame states, and judge."""
        if not self._noted:
            self._noted = True
            self._last_s = t_s
            self._noted_s = self._still_since_s = now_s
            self._begin(t_s, now_s)
            return
        step_s, elapsed_s = t_s - self._last_s, now_s - self._noted_s
        is_still = -STEP_S < step_s < STEP_S
        if is_still and elapsed_s < DATAGRAM_S:
            return
        self._last_s, self._noted_s = t_s, now_s
        self._frames += 1
        if is_still:
            self._still += 1
        else:
            self._still, self._still_since_s = 0, now_s
            self._steps += 1
        if not -JUMP_S < step_s - elapsed_s < JUMP_S:
            self._jump(t_s, now_s, step_s)
            return
        self._jumps = 0
        self._judge(now_s)

    def _begin(self, t_s: float, now_s: float) -> None:
        self._begun_s, self._begun_at_s, self._frames, self._steps = t_s, now_s, 0, 0

    def _jump(self, t_s: float, now_s: float, step_s: float) -> None:
        """A clock may jump once, when it was set or has wrapped around; one that jumps at every frame is none."""
        self._jumps += 1
        self._begin(t_s, now_s)
        if self._jumps >= STILL_FRAMES:
            self._condemn(f"jumps by {step_s:.3g} s from frame to frame")

    def _judge(self, now_s: float) -> None:
        elapsed_s, passed_s = now_s - self._begun_at_s, self._last_s - self._begun_s
        if self._still >= STILL_FRAMES and now_s - self._still_since_s >= STILL_S:
            self._condemn(_STILL)
        elif (
            self.runs is None
            and self._frames >= STILL_FRAMES
            and elapsed_s >= 0.5 * WINDOW_S
            and passed_s < MUCH_TOO_SLOW * elapsed_s
        ):
            self._condemn(_speed(passed_s, elapsed_s))
        if elapsed_s < WINDOW_S or self._frames < STILL_FRAMES:
            return
        speed = passed_s / elapsed_s
        if not self._plausible[0] <= speed <= self._plausible[1]:
            self._bad += 1
            if self._bad > 1:
                self._condemn(_speed(passed_s, elapsed_s))
        elif self._steps < MOVING_SHARE * self._frames:
            self._bad += 1
            if self._bad > 1:
                self._condemn("advances in steps that are longer than a frame")
        else:
            self._bad = 0
            self._good += 1
            if self.runs is None or self._good > 1:
                self.runs, self.fault = True, ""
        self._begin(self._last_s, now_s)

    def _condemn(self, fault: str) -> None:
        self.runs, self.fault, self._good = False, fault, 0


class SenderClock:
    """The clocks of one sender, best first, and which of them its frames go by."""

    def __init__(self, names: Iterable[str], plausible: tuple[float, float] = PLAUSIBLE) -> None:
        self.clocks = tuple(Clock(name, i, plausible) for i, name in enumerate(names))
        self._used: Clock | None = None
        self._has_forgotten = False
        """Whether it matters how many frames in a row state a clock."""
        self._arrivals = deque[float](maxlen=_RATE_FRAMES)
        self._last_s = -math.inf

    @property
    def used(self) -> str:
        """The name of the clock in use."""
        return ARRIVAL if self._used is None else self._used.name

    def report(self) -> dict[str, object]:
        """The clock in use, and the clocks that were set aside with the reason for each."""
        return {"used": self.used, "set_aside": self.set_aside()}

    def set_aside(self) -> dict[str, str]:
        """The clocks that do not run, and why."""
        return {clock.name: clock.fault for clock in self.clocks if clock.runs is False}

    def forget(self) -> None:
        """Go by the next clock that frames state, because the sender no longer states the one in use."""
        if self._used is not None:
            self._used.needs = FORGOTTEN_FRAMES
            self._has_forgotten = True
        self._used = None

    def choose(self, stated_s: tuple[float | None, ...], now_s: float, repeats: bool) -> float | None:
        """The time of a frame that states these times and arrived at `now_s`, or None if it lacks the one in use.

        A frame that `repeats` the one before is not spread when the arrivals come in bunches.
        """
        if self._has_forgotten:
            for clock, t_s in zip(self.clocks, stated_s, strict=True):
                clock.streak = 0 if t_s is None else clock.streak + 1
        used = self._used
        if used is None or used.runs is False:
            used = self._used = self._best(stated_s)
        return self._arrival_s(now_s, repeats) if used is None else stated_s[used.place]

    def _best(self, stated_s: tuple[float | None, ...]) -> Clock | None:
        stated = [clock for clock, t_s in zip(self.clocks, stated_s, strict=True) if t_s is not None]
        trusted = (each for each in stated if each.runs or (each.runs is None and not each.doubtful))
        return next((clock for clock in trusted if clock.needs == 1 or clock.streak >= clock.needs), None)

    def _arrival_s(self, now_s: float, repeats: bool) -> float:
        """The arrival of a frame. Frames that arrive together are spread by the sender's usual interval."""
        self._arrivals.append(now_s)
        t_s = now_s
        if len(self._arrivals) > 2 and not repeats:
            interval_s = (now_s - self._arrivals[0]) / (len(self._arrivals) - 1)
            if now_s - self._last_s < 0.5 * interval_s:
                t_s = min(self._last_s + interval_s, now_s + AHEAD_S)
        self._last_s = max(t_s, self._last_s)
        return t_s


def _speed(passed_s: float, elapsed_s: float) -> str:
    """The fault of a clock that advanced by `passed_s` in `elapsed_s` of ours."""
    return _STILL if abs(passed_s) < STEP_S else f"advances by {passed_s / elapsed_s:.3g} s per second"
