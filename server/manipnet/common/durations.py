"""How often durations occurred, in classes so narrow that percentiles are right to a thousandth."""

import math
from typing import Final

import numpy as np

SHORTEST_S: Final = 1e-6
LONGEST_S: Final = 60.0
"""Durations beyond these count as these."""
_RATIO: Final = math.log(1.002)
"""The logarithm of the width of a class, relative to its durations."""
_CLASSES: Final = math.ceil(math.log(LONGEST_S / SHORTEST_S) / _RATIO) + 1
_MOST_WAITING: Final = 256
"""Durations that are sorted into classes together, which costs a fraction of doing so one by one."""


class Durations:
    """A histogram of durations in seconds, of constant size."""

    def __init__(self) -> None:
        self.count, self.sum_s = 0, 0.0
        self._waiting: list[float] = []
        self._counts = np.zeros(_CLASSES, np.int64)

    def add(self, seconds: float) -> None:
        """Add one duration."""
        self.count += 1
        self.sum_s += seconds
        self._waiting.append(seconds)
        if len(self._waiting) >= _MOST_WAITING:
            self._sort()

    def percentile(self, percent: float) -> float:
        """The duration, in seconds, that this share of all does not exceed; zero if there are none."""
        self._sort()
        if not self.count:
            return 0.0
        rank = max(math.ceil(1e-2 * percent * self.count), 1)
        return SHORTEST_S * math.exp(_RATIO * float(np.searchsorted(np.cumsum(self._counts), rank)))

    def _sort(self) -> None:
        seconds = np.clip(np.array(self._waiting), SHORTEST_S, LONGEST_S)
        np.add.at(self._counts, np.rint(np.log(seconds / SHORTEST_S) / _RATIO).astype(np.intp), 1)
        self._waiting.clear()
