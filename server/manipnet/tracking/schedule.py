"""When the next tick of a run falls due: with the frames of its look-ahead or, in a silence, by our clock."""

from typing import Final

import numpy as np

from manipnet.tracking.pose_buffer import TIME_TOLERANCE_S
from manipnet.tracking.run import Run
from manipnet.tracking.tick import TICK_S

SLEW: Final = 0.25
"""A changed look-ahead is reached by ticks that come faster or slower by this share, so that none is missing."""


class Schedule:
    """Waits for the look-ahead of each tick, but never for long."""

    def __init__(self, look_ahead_s: float) -> None:
        self.look_ahead_s = look_ahead_s
        """The requested look-ahead; it may change at any time."""
        self.effective_s = look_ahead_s
        """The look-ahead of the next tick, on its way to the requested one."""

    def begin(self) -> None:
        """Start with the requested look-ahead, before the first tick of a stream."""
        self.effective_s = self.look_ahead_s

    def due_s(self, run: Run, index: int) -> float:
        """Stream time that must have arrived before a tick can be shown."""
        return run.tick_s(index) + self.effective_s

    def reached_s(self, run: Run, now_s: float) -> float:
        """Stream time that the ticks may use: what has arrived, or our clock in a silence."""
        now_s += TIME_TOLERANCE_S  # a poll at exactly the time of `next_poll_s` must not be early by a rounding error
        if now_s - run.arrivals.heard_s >= run.arrivals.silence_s():
            return run.arrivals.clock_s(now_s)
        if now_s >= _patience_s(run):
            return max(run.arrived_s(), self.due_s(run, run.next_index))
        return run.arrived_s()

    def next_poll_s(self, run: Run, is_ending: bool) -> float:
        """Our clock when the next tick falls due if no frame arrives before. A run `is_ending` goes by our clock."""
        arrivals = run.arrivals
        quiet_until_s = arrivals.heard_s + (0.0 if is_ending else arrivals.silence_s())
        by_clock_s = arrivals.heard_s + self.due_s(run, run.next_index) - arrivals.newest_s
        return min(max(quiet_until_s, by_clock_s), _patience_s(run))

    def slew(self) -> None:
        """Move the look-ahead toward the requested one, after each tick."""
        step_s = SLEW * TICK_S
        self.effective_s += min(max(self.look_ahead_s - self.effective_s, -step_s), step_s)


def _patience_s(run: Run) -> float:
    """When a tick goes without its frames because our clock had run ahead of a sender that came back.

    Ticks then come a little slower, until the sender has caught up, instead of stopping.
    """
    return np.inf if run.carried_s is None else run.carried_s + TICK_S * (1.0 + SLEW)
