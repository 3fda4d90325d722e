"""An estimate of the sender's clock that removes jitter and makes no steps."""

from __future__ import annotations

import math
from collections import deque

WINDOW = 64
"""Number of arrivals, about one second, of which the quickest one sets the target."""

STIFFNESS_HZ = 2.0
"""How quickly the offset follows the target: a correction of 20 ms changes the display's speed by at most 1.5 %."""

SNAP_S = 0.25
"""A larger error means that a clock has jumped; the offset follows it at once."""


class SmoothClock:
    """The offset between local and sender's clock: a critically damped spring towards the smallest recent offset."""

    def __init__(self) -> None:
        self._offsets: deque[float] = deque(maxlen=WINDOW)
        self._offset_s = self._speed = self._now_s = 0.0

    @property
    def target_s(self) -> float:
        """The smallest difference of arrival and capture time among the last `WINDOW` arrivals, seconds."""
        return min(self._offsets)

    def observe(self, arrival_s: float, capture_s: float) -> None:
        """Record one arrival."""
        first = not self._offsets
        self._offsets.append(arrival_s - capture_s)
        if first:
            self._offset_s, self._speed, self._now_s = self.target_s, 0.0, arrival_s

    def capture_time(self, now_s: float) -> float:
        """The sender's time at the local time `now_s`, which must not decrease between calls."""
        step_s, self._now_s = max(now_s - self._now_s, 0.0), max(now_s, self._now_s)
        error = self._offset_s - self.target_s
        if abs(error) > SNAP_S:
            self._offset_s, self._speed = self.target_s, 0.0
            return now_s - self._offset_s
        pull = self._speed + STIFFNESS_HZ * error
        decay = math.exp(-STIFFNESS_HZ * step_s)
        self._offset_s = self.target_s + (error + pull * step_s) * decay
        self._speed = (self._speed - STIFFNESS_HZ * pull * step_s) * decay
        return now_s - self._offset_s
