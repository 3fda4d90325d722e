"""The last check before a pose leaves: finite, inside its limits, no faster than fingers move."""

from typing import Final

import numpy as np

from manipnet.geometry import Array
from manipnet.telemetry import Counters

MAX_SPEED_RAD_S: Final = 40.0
"""The fastest captured finger reaches 35; only an error moves faster than this."""


class NotFiniteError(ArithmeticError):
    """A pose holds a number that is not finite."""


class OutputGuard:
    """Keeps finger angles harmless, and counts what it had to change."""

    def __init__(self, limits: Array, counters: Counters) -> None:
        self._limits, self._counters = limits, counters

    def finite(self, angles: Array) -> Array:
        """The same `angles`; raises `NotFiniteError`."""
        if not np.isfinite(angles).all():
            self._counters.add("output_guarded", reason="not_finite")
            raise NotFiniteError("a synthesised angle is not finite")
        return angles

    def within(self, angles: Array, last: Array, dt_s: float) -> Array:
        """`angles (20,)` kept inside their limits and in reach of the `last` ones, `dt_s` before."""
        reach = MAX_SPEED_RAD_S * dt_s
        safe = self._kept("limit", angles, self._limits[:, 0], self._limits[:, 1])
        return self._kept("speed", safe, last - reach, last + reach)

    def _kept(self, reason: str, angles: Array, low: Array, high: Array) -> Array:
        kept = np.clip(angles, low, high)
        if np.abs(kept - angles).max() > 1e-6:
            self._counters.add("output_guarded", reason=reason)
        return kept
