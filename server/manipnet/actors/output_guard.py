"""The last check before a pose leaves: it must be finite, inside its limits, and no faster than fingers can move."""

import math
from typing import Final

import numpy as np

from manipnet.geometry import Array
from manipnet.synthesis.hand.limits import keep_angles
from manipnet.telemetry import Telemetry

MAX_SPEED_RAD_S: Final = 40.0
"""The fastest captured finger reaches 35 rad/s, so only an error moves faster than this."""
MAX_WRIST_M_S: Final = 20.0
MAX_WRIST_RAD_S: Final = 40.0
"""No hand moves faster than this either."""


class NotFiniteError(ArithmeticError):
    """A pose holds a number that is not finite, or a quaternion that is not a rotation."""


class OutputGuard:
    """Keeps finger angles harmless, and counts what it had to change."""

    def __init__(self, limits: Array, telemetry: Telemetry) -> None:
        """`limits (20, 2)` are in radians."""
        self._limits, self._telemetry = limits, telemetry

    def check(self, angles: Array | None, wrist: Array | None) -> None:
        """Raise `NotFiniteError` for `angles (20,)` or a `wrist (7,)` that must not be shown."""
        # a dot product with itself takes a quarter of the time of a sum
        if angles is not None and not math.isfinite(angles @ angles):
            self._refuse("a synthesised angle is not finite")
        if wrist is not None and not (math.isfinite(wrist @ wrist) and abs(wrist[3:] @ wrist[3:] - 1.0) < 1e-3):
            self._refuse("a wrist is not a pose: a number is not finite, or the quaternion is not of length 1")

    def inside(self, angles: Array) -> Array:
        """`angles (20,)` clipped to their limits."""
        return self._clip(angles, angles, math.inf)

    def within(self, angles: Array, last: Array, dt_s: float) -> Array:
        """`angles (20,)` clipped to their limits and to what can be reached from the `last` ones within `dt_s`."""
        return self._clip(angles, last, MAX_SPEED_RAD_S * dt_s)

    def is_reachable(self, step_m: float, turn_rad: float, dt_s: float) -> bool:
        """Whether a wrist can move this far within `dt_s`."""
        reachable = step_m <= MAX_WRIST_M_S * dt_s and turn_rad <= MAX_WRIST_RAD_S * dt_s
        if not reachable:
            self._telemetry.count("output_guarded", reason="speed")
        return reachable

    def _refuse(self, why: str) -> None:
        self._telemetry.count("output_guarded", reason="not_finite")
        raise NotFiniteError(why)

    def _clip(self, angles: Array, last: Array, reach_rad: float) -> Array:
        clipped = np.empty_like(angles)
        beyond_limits, too_fast = keep_angles(angles, self._limits, last, reach_rad, clipped)
        if beyond_limits:
            self._telemetry.count("output_guarded", reason="limit")
        if too_fast:
            self._telemetry.count("output_guarded", reason="speed")
        return clipped
