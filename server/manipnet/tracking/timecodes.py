"""The SMPTE timecode of instants, from the timecodes of the frames around them."""

from collections import deque
from typing import Final

from manipnet.tracking.pose_buffer import TIME_TOLERANCE_S

KEEP: Final = 1024
STANDS_S: Final = 0.2
"""How long the timecode of a frame stands for instants after it."""

Timecode = tuple[str | None, float | None]
"""HH:MM:SS:FF, and the frames per second if they are known."""


class Timecodes:
    """The timecodes of the newest frames of a sender."""

    def __init__(self) -> None:
        self._noted: deque[tuple[float, str, float | None]] = deque(maxlen=KEEP)

    def note(self, t_s: float, timecode: str, rate: float | None) -> None:
        """Note the timecode of a frame at an instant of stream time."""
        self._noted.append((t_s, timecode, rate))

    def at(self, t_s: float) -> Timecode:
        """The timecode of the newest frame that is not after an instant, if it is not far before it."""
        for noted_s, timecode, rate in reversed(self._noted):
            if -TIME_TOLERANCE_S <= t_s - noted_s < STANDS_S:
                return timecode, rate
        return None, None
