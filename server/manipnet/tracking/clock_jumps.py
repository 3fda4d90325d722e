"""Frames whose time is far from the stream's: a bad stamp, a frame that was delayed, or a sender that restarted."""

from dataclasses import dataclass
from typing import Final

from manipnet.tracking.arrivals import Arrivals
from manipnet.tracking.tick import Poses

RESTART_S: Final = 0.5
"""A frame this far behind the stream, or `AHEAD_S` ahead of it, may come from a sender that restarted."""
AHEAD_S: Final = 0.5
LATE_S: Final = 10.0
"""A frame up to this far behind was delayed on its way; an older frame comes from a different clock."""
CLOCK_JUMP_CONFIRMATIONS: Final = 3
"""Frames in a row that must agree on a new time before the stream follows it: one bad stamp must not move it."""


@dataclass(frozen=True, slots=True)
class HeldFrame:
    """A frame that is held back: its time, its bodies, and our clock when it arrived."""

    t_s: float
    poses: Poses
    now_s: float


class ClockJumps:
    """Holds frames of an unlikely time back until enough of them agree."""

    def __init__(self) -> None:
        self._held: list[HeldFrame] = []

    @staticmethod
    def is_likely(arrivals: Arrivals, t_s: float, now_s: float) -> bool:
        """Whether a frame of the time `t_s` can continue the stream. After a silence the stream may be further on."""
        silent_for_s = now_s - arrivals.heard_s
        return -RESTART_S < t_s - arrivals.newest_s < AHEAD_S + 1.5 * silent_for_s

    def forget(self) -> None:
        """Give up the frames that are held back, because the stream goes on."""
        self._held.clear()

    def hold(self, frame: HeldFrame) -> list[HeldFrame]:
        """Hold a frame back. Returns all held frames once enough agree on a new time, otherwise an empty list."""
        if self._held and not 0.0 < frame.t_s - self._held[-1].t_s < AHEAD_S:
            self._held.clear()
        self._held.append(frame)
        return list(self._held) if len(self._held) >= CLOCK_JUMP_CONFIRMATIONS else []


def drop_reason(arrivals: Arrivals, t_s: float) -> str:
    """Why a frame of an unlikely time is not used, one of `telemetry.DROP_REASONS`."""
    return "late" if 0.0 < arrivals.newest_s - t_s < LATE_S else "time_jump"
