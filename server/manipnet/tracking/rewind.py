"""A sender that resumes after it stood still: our clock has carried the ticks on meanwhile, and they must go back."""

from typing import Final

from manipnet.tracking.clock_jumps import RESTART_S
from manipnet.tracking.run import Run
from manipnet.tracking.schedule import Schedule

CATCH_UP_S: Final = 0.25
"""A sender that was late, and did not stand still, has this long to deliver the frames that it kept back."""


class Rewind:
    """Rewinds a run to where its sender resumed, unless the sender was only late and catches up."""

    def __init__(self, schedule: Schedule) -> None:
        self._schedule = schedule
        self._resumed: tuple[int, float] | None = None
        """The tick at which the sender resumed, and our clock when it did."""

    @property
    def is_idle(self) -> bool:
        """Whether there is nothing to rewind to."""
        return self._resumed is None

    def forget(self) -> None:
        """Do not rewind, because a new run begins."""
        self._resumed = None

    def note(self, run: Run, t_s: float, now_s: float) -> None:
        """Note a frame of the time `t_s` that arrives now."""
        silent_for_s = now_s - run.arrivals.heard_s
        if silent_for_s > run.arrivals.silence_s() and self._is_ahead_of(run, t_s):
            self._resumed = (run.index_at(t_s), now_s)

    def apply(self, run: Run, now_s: float) -> bool:
        """Rewind a run if it is time to; returns whether it was."""
        if self._resumed is None:
            return False
        index, since_s = self._resumed
        arrived_s = run.arrived_s()
        if not self._is_ahead_of(run, arrived_s):
            self._resumed = None
        elif now_s - since_s >= CATCH_UP_S and arrived_s >= self._schedule.due_s(run, index):
            self._resumed, run.carried_s = None, None
            run.next_index, run.number = index, run.number + 1
            return True
        return False

    def _is_ahead_of(self, run: Run, t_s: float) -> bool:
        """Whether our clock has carried the ticks far beyond a time of the sender."""
        return self._schedule.due_s(run, run.next_index) - t_s > RESTART_S
