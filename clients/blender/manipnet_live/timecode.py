"""SMPTE timecode as a number of frames."""

from __future__ import annotations

import re

_TEXT = re.compile(r"(\d\d):(\d\d):(\d\d)([:;])(\d\d)")


def timecode_frames(timecode: str, rate_hz: float) -> int:
    """The frames counted since 00:00:00:00; ";" before the frames means drop frame, which skips frame numbers.

    Raises `ValueError` for text that is not a timecode.
    """
    found = _TEXT.fullmatch(timecode)
    if found is None:
        raise ValueError(f"{timecode!r} is not a timecode; it must have the form HH:MM:SS:FF")
    hours, minutes, seconds, frames = (int(found[i]) for i in (1, 2, 3, 5))
    counted = round(rate_hz)
    total = (3600 * hours + 60 * minutes + seconds) * counted + frames
    if found[4] == ";":
        dropped = round(counted / 15)  # two numbers at 30 frames per second, in each minute that 10 does not divide
        minute = 60 * hours + minutes
        total -= dropped * (minute - minute // 10)
    return total
