"""When the frames of a run arrived by our clock, and from when on their absence counts as silence."""

from collections import deque
from statistics import median
from typing import Final

from manipnet.tracking.pose_buffer import TIME_TOLERANCE_S

SILENCE_S: Final = 0.06
"""A stream is silent after this long without a frame, or after three usual intervals if that is longer."""


class Arrivals:
    """Relates stream time, which is the sender's clock, to our clock."""

    def __init__(self, t0_s: float, now_s: float) -> None:
        self.newest_s, self.heard_s = t0_s, now_s
        """Stream time of the newest frame, and our clock when it arrived."""
        self._gaps_s = deque[float](maxlen=32)
        self._arrivals = deque[tuple[float, float]](maxlen=1024)
        self._silence_s: float | None = SILENCE_S
        """What `silence_s` returned last; None if frames have arrived since."""

    def note(self, t_s: float, now_s: float) -> None:
        """Note a frame of stream time `t_s`; one that is late changes nothing."""
        if t_s > self.newest_s:
            self._gaps_s.append(now_s - self.heard_s)
            self._silence_s = None
            self.newest_s, self.heard_s = t_s, now_s
            self._arrivals.append((t_s, now_s))

    def silence_s(self) -> float:
        """How long without a frame counts as silence."""
        if self._silence_s is None:
            self._silence_s = max(SILENCE_S, 3.0 * median(self._gaps_s))
        return self._silence_s

    def clock_s(self, now_s: float) -> float:
        """Stream time if the sender's clock went on since its newest frame."""
        return self.newest_s + (now_s - self.heard_s)

    def reached_at_s(self, t_s: float) -> float:
        """Our clock when the stream reached `t_s`, by a frame or in a silence. `t_s` must rise from call to call."""
        while self._arrivals and self._arrivals[0][0] < t_s - TIME_TOLERANCE_S:
            self._arrivals.popleft()
        return self._arrivals[0][1] if self._arrivals else self.heard_s + t_s - self.newest_s
