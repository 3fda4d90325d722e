"""The SMPTE timecode of a take or an animation, frame by frame."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from manipnet.geometry import Array
from manipnet.tracking.pose_buffer import TIME_TOLERANCE_S
from manipnet.tracking.timecodes import STANDS_S, Timecode


@dataclass(frozen=True)
class TimecodeTrack:
    """`texts` holds HH:MM:SS:FF (";" before FF for drop frame) for each of T frames, or "" where it is not known.

    `rate` is the number of timecode frames per second, if it is known.
    """

    texts: tuple[str, ...]
    rate: float | None = None

    @classmethod
    def of(cls, timecodes: Iterable[Timecode]) -> "TimecodeTrack | None":
        """The track of frames that may have a timecode, or None if no frame has one."""
        pairs = list(timecodes)
        if not any(text for text, _ in pairs):
            return None
        rates = [rate for _, rate in pairs if rate is not None]
        return cls(tuple(text or "" for text, _ in pairs), rates[-1] if rates else None)

    def at(self, time_s: Array, wanted_s: Array) -> "TimecodeTrack":
        """The track at other times, of frames at the rising times `time_s (T,)`.

        A time has the timecode of the newest frame that is not after it and not far before it.
        """
        before = np.searchsorted(time_s, wanted_s + TIME_TOLERANCE_S, side="right") - 1
        texts = [
            self.texts[k] if k >= 0 and t_s - time_s[k] < STANDS_S else ""
            for k, t_s in zip(before.tolist(), wanted_s.tolist(), strict=True)
        ]
        return TimecodeTrack(tuple(texts), self.rate)

    def __getitem__(self, frames: slice) -> "TimecodeTrack":
        return TimecodeTrack(self.texts[frames], self.rate)

    def arrays(self) -> dict[str, Array]:
        """The arrays of a file of `manipnet synthesize`: `timecode (T,)` as text, and `timecode_rate`, or NaN."""
        return {
            "timecode": np.array(self.texts),
            "timecode_rate": np.array(np.nan if self.rate is None else self.rate),
        }


def timecode_of(arrays: dict[str, Array]) -> TimecodeTrack | None:
    """The track in the arrays of a file of `manipnet synthesize`, if it has one."""
    if "timecode" not in arrays:
        return None
    rate = float(arrays.get("timecode_rate", np.array(np.nan)))
    return TimecodeTrack(tuple(arrays["timecode"].tolist()), None if np.isnan(rate) else rate)
