"""Infers the rate of a timecode from the frame number after which the seconds advance.

Neither NatNet nor a bridge that sends OSC states the rate.
"""

from typing import Final

RATES: Final = (24, 25, 30, 48, 50, 60)


class TimecodeRate:
    """The rate of a timecode, once two seconds in a row have had the same number of frames."""

    def __init__(self) -> None:
        self.rate: float | None = None
        self._timecode = self._second = ""
        self._first = self._highest = 0
        self._counted = 0

    def note(self, timecode: str) -> float | None:
        """Take the timecode HH:MM:SS:FF of a frame; returns the rate as far as it is known."""
        if timecode == self._timecode:  # most frames share it with the one before
            return self.rate
        self._timecode = timecode
        second, frame = timecode[:8], int(timecode[9:])
        if second != self._second:
            count = self._highest + 1 if self._first <= 1 else 0  # some kinds of counting drop the first numbers
            self.rate = float(count) if count in RATES and count == self._counted else self.rate
            self._second, self._first, self._highest, self._counted = second, frame, frame, count
        self._highest = max(self._highest, frame)
        return self.rate
