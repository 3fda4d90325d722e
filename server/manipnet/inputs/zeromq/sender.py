"""What is known about one sender over ZeroMQ: its clock, and whether its messages have waited for the connection.

A publisher that was connected before keeps what it sends while nothing listens, and delivers it in one burst when the
server has started. If the sender states when each frame was captured, these frames are as good as others. Otherwise
nobody can tell when they were captured, because they all arrive at once.
"""

import math
from typing import Final

from manipnet.inputs.sender_clock import ARRIVAL, PLAUSIBLE, STEP_S, SenderClock
from manipnet.wire.bodies import BodyFrame

CLOCK_SPEEDS: Final = (PLAUSIBLE[0] / 5.0, math.inf)
"""A sender may play as slowly or as fast as it likes; a wrong unit shows in jumps from frame to frame."""
BACKLOG_S: Final = 1.0
"""A backlog has arrived within this time after the first message, or after a silence as long as this."""
TOGETHER_S: Final = 0.002
"""Messages that are sent at 360 Hz are farther apart than this. Those that have waited are closer."""


class ZmqSender:
    """One sender. Reads no clock: arrival times are arguments."""

    def __init__(self) -> None:
        self.clock = SenderClock(("t",), CLOCK_SPEEDS)
        self._heard_s = self._begun_s = -math.inf
        self._newest: BodyFrame | None = None

    def time(self, frame: BodyFrame) -> float | None:
        """When a frame was captured: its `t`, or its arrival if the sender's `t` is no running clock.

        None for a frame that has waited for the connection and does not say when it was captured.
        """
        self.clock.clocks[0].note(frame.t_s, frame.t_received_s)
        t_s = self.clock.choose((frame.t_s,), frame.t_received_s, repeats=False)
        return None if self._is_backlog(frame) else t_s

    def _is_backlog(self, frame: BodyFrame) -> bool:
        now_s, newest = frame.t_received_s, self._newest
        gap_s, self._heard_s, self._newest = now_s - self._heard_s, now_s, frame
        if gap_s > BACKLOG_S or newest is None:
            self._begun_s = now_s
            return False
        if gap_s > TOGETHER_S or now_s - self._begun_s > BACKLOG_S:
            return False
        has_time = self.clock.used != ARRIVAL and abs(frame.t_s - newest.t_s) >= STEP_S
        # Some senders send each body of an instant in a message of its own.
        return not has_time and [each[:2] for each in frame.bodies] == [each[:2] for each in newest.bodies]
