"""SMPTE timecode as text: HH:MM:SS:FF, or HH:MM:SS;FF if the counting drops frame numbers."""

import re
from functools import lru_cache
from typing import Final

MAX_RATE: Final = 1_000.0
_TEXT: Final = re.compile(r"(\d\d):([0-5]\d):([0-5]\d)[:;](\d\d)")


@lru_cache(maxsize=4)
def timecode_text(packed: int) -> str | None:
    """The timecode that NatNet packs into an integer: hours, minutes, seconds and frames in a byte each.

    None for zero, which is sent when there is no timecode, and for what is no time.
    """
    hours, minutes, seconds, frames = packed >> 24 & 255, packed >> 16 & 255, packed >> 8 & 255, packed & 255
    if not packed or hours > 23 or minutes > 59 or seconds > 59 or frames > 99:
        return None
    return f"{hours:02d}:{minutes:02d}:{seconds:02d}:{frames:02d}"


def is_timecode(value: object) -> bool:
    """Whether a value is a timecode as text."""
    found = _TEXT.fullmatch(value) if isinstance(value, str) else None
    return found is not None and int(found[1]) < 24


def is_rate(value: object) -> bool:
    """Whether a value is a number of timecode frames per second."""
    return isinstance(value, int | float) and not isinstance(value, bool) and 0.0 < value <= MAX_RATE
