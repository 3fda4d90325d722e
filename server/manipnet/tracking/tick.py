"""The tick: one instant of stream time, and the tracked bodies as they are seen from it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from manipnet.geometry import Array
from manipnet.synthesis.model.layout import PRESENT, WINDOW_OFFSETS_S
from manipnet.tracking.noise import UNKNOWN, Noise
from manipnet.tracking.pose_buffer import TIME_TOLERANCE_S, Forecast, PoseBuffer, sample
from manipnet.tracking.smoothing import Smoothing

TICK_HZ: Final = 60
TICK_S: Final = 1.0 / TICK_HZ
CURRENT_S: Final = 1.0
"""A body of which nothing has come for longer than this has no rate any more."""

Pose = Array | Sequence[float]
Poses = Mapping[str, Pose | None]
"""The bodies of one frame: world poses `(7,)` by name; None for a body that is not tracked."""


@dataclass(frozen=True, slots=True)
class BodyAtTick:
    """One body at one tick: `window (21, 7)` around the tick and `pose (7,)` at the tick, in the world frame.

    `age_s` is the time from its newest tracked sample to the tick. The pose is `known` if it lies between samples; it
    is not if it lies beyond the newest one.
    """

    window: Array
    pose: Array
    age_s: float
    known: bool = True


@dataclass(frozen=True, slots=True)
class BodyHealth:
    """How a body arrives: the rate of its tracked samples, the age of the newest one, and their noise.

    The age is by the stream's clock. The rate is the present one: zero once nothing has come for `CURRENT_S`.
    """

    rate_hz: float
    age_s: float
    noise: Noise = UNKNOWN


@dataclass(frozen=True, slots=True)
class Tick:
    """One instant to show. `run` counts sender restarts, and `index` the ticks of a run."""

    run: int
    index: int
    time_s: float
    """The instant, by the sender's clock."""
    look_ahead_s: float
    waited_for_s: float
    """When, by our clock, everything that the tick needed had arrived, or our clock let it fall due."""
    silent: bool
    """Whether our clock, not a frame, let the tick fall due."""
    bodies: Mapping[str, BodyAtTick]
    """The bodies that were tracked at least once in this run."""


def bodies_at(
    time_s: float,
    until_s: float,
    tracks: Mapping[str, PoseBuffer],
    forecast: Forecast | None,
    smoothing: Smoothing | None = None,
) -> dict[str, BodyAtTick]:
    """The bodies as they are seen from the instant `time_s`, from samples up to `until_s`.

    Without a `forecast` the last pose of a body stands for its future.
    """
    tracked = {name: track for name, track in tracks.items() if track.newest_s > -math.inf}
    if not tracked:
        return {}
    windows, ages = sample(list(tracked.values()), time_s + WINDOW_OFFSETS_S, time_s, until_s, forecast, smoothing)
    return {
        name: BodyAtTick(window, window[PRESENT], age_s, time_s <= track.newest_s + TIME_TOLERANCE_S)
        for (name, track), window, age_s in zip(tracked.items(), windows, ages, strict=True)
    }
