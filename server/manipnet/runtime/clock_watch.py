"""Warns about senders whose clocks cannot be right: in another unit, too fast or too slow, or never believed."""

import logging
from collections.abc import Mapping
from typing import Any, Final

from manipnet.common.log_limits import LogThrottle

LASTS_LOOKS: Final = 6
"""A clock must be wrong for this many seconds before a line is logged: a replay that begins again is right soon, and so
is a sender that makes up for a second in which its machine was busy."""
UNIT_SPEED: Final = 50.0
"""A clock this fast does not count seconds."""
TOLERANCE: Final = 0.1
"""Speeds within this of real time are those of a good clock with uneven arrivals."""
MOST_DROPPED: Final = 0.8
LOG_PERIOD_S: Final = 60.0
LIVE_AGE_S: Final = 2.0
_log = logging.getLogger(__name__)


class ClockWatch:
    """Looks at all senders once per second. Belongs to the tick thread."""

    def __init__(self) -> None:
        self._wrong: dict[str, int] = {}
        """By source, for how many seconds its clock has been wrong."""
        self._doubted, self._frames, self._jumps = 0, 0, 0
        self._log_throttle = LogThrottle(LOG_PERIOD_S)

    def look(self, senders: Mapping[str, Mapping[str, Any]], counts: Mapping[str, Mapping[str, int]]) -> None:
        """Check the `senders` of `SenderStats.report` and the counters of the session."""
        wrong: dict[str, int] = {}
        for source, sender in senders.items():
            speed = sender["clock_speed"]
            if speed is not None and sender["age_s"] < LIVE_AGE_S and abs(speed - 1.0) > TOLERANCE:
                wrong[source] = self._wrong.get(source, 0) + 1
                if wrong[source] >= LASTS_LOOKS:
                    self._report_speed(source, speed)
        self._wrong = wrong
        self._look_at_jumps(counts)

    def _report_speed(self, source: str, speed: float) -> None:
        if self._log_throttle.admit(source) is None:
            return
        if abs(speed) >= UNIT_SPEED:
            _log.warning(
                "%s: its times advance by %.3g per second, so they are not in seconds; send t in seconds over ZeroMQ, "
                "and /frame/timestamp in milliseconds over OSC",
                source,
                speed,
            )
        elif speed > TOLERANCE:
            _log.warning(
                "%s: its clock runs at %.2f times real time, and the hands follow it; a replay may do so, but a "
                "tracker must send the time of each capture in seconds",
                source,
                speed,
            )
        else:
            _log.warning("%s: its times do not rise; send the time of each capture in seconds", source)

    def _look_at_jumps(self, counts: Mapping[str, Mapping[str, int]]) -> None:
        """Warn when nearly all frames are dropped since their times neither continue the stream nor begin another."""
        frames, jumps = sum(counts.get("frames_in", {}).values()), counts.get("frames_dropped", {}).get("time_jump", 0)
        arrived, dropped = frames - self._frames, jumps - self._jumps
        self._frames, self._jumps = frames, jumps
        self._doubted = self._doubted + 1 if arrived and dropped >= MOST_DROPPED * arrived else 0
        if self._doubted >= LASTS_LOOKS and self._log_throttle.admit("") is not None:
            _log.warning(
                "nearly all frames are dropped (time_jump): their times do not continue the stream, and no three in a "
                "row are less than half a second apart; send t in seconds of one clock that rises from frame to frame"
            )
