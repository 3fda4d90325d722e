"""Takes as another tracking system would have streamed them: noise, another rate, lost bodies."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from manipnet.geometry import Array, quat_exp, quat_multiply, quat_normalize
from manipnet_tools.takes.take import BodyTrack, Take

STEADY_S: Final = 0.75
"""Nothing is lost in this time at the start of a take, so that every body is known from the first tick on."""
LONGEST_LOSS: Final = 7
"""A body is lost for one to this many frames at a time."""


@dataclass(frozen=True)
class Tracker:
    """The faults of a tracking system; the noise is white, and its standard deviations are per axis."""

    position_m: float = 0.0
    rotation_rad: float = 0.0
    rate_hz: float | None = None
    """None keeps the rate of the take."""
    jitter_s: float = 0.0
    """Standard deviation of the error of the time stamps."""
    losses: float = 0.0
    """The share of the frames in which a body begins to be lost."""


def tracked_by(tracker: Tracker, take: Take, seed: int = 0) -> Take:
    """The take as the tracker sees it; the same seed gives the same noise."""
    rng = np.random.default_rng(seed)
    if tracker.rate_hz is not None:
        take = _resampled(take, tracker.rate_hz)
    bodies = {name: _seen(tracker, track, take, rng) for name, track in take.bodies.items()}
    time_s = take.time_s.copy()
    if tracker.jitter_s:
        limit_s = 0.4 / take.rate_hz  # frames stay in their order
        time_s[1:] += np.clip(tracker.jitter_s * rng.normal(size=len(time_s) - 1), -limit_s, limit_s)
    return replace(take, time_s=time_s, bodies=bodies)


def _seen(tracker: Tracker, track: BodyTrack, take: Take, rng: np.random.Generator) -> BodyTrack:
    noise = rng.normal(size=(len(track.poses), 6)) * np.repeat([tracker.position_m, tracker.rotation_rad], 3)
    turned = quat_multiply(quat_exp(noise[:, 3:]), track.poses[:, 3:])
    tracked = track.tracked
    if tracker.losses:
        tracked = tracked.copy()
        for frame in np.flatnonzero(rng.random(len(tracked)) < tracker.losses):
            tracked[frame : frame + rng.integers(1, LONGEST_LOSS + 1)] = False
        tracked[: int(STEADY_S * take.rate_hz)] = track.tracked[: int(STEADY_S * take.rate_hz)]
    return BodyTrack(np.concatenate([track.poses[:, :3] + noise[:, :3], turned], axis=1), tracked)


def _resampled(take: Take, rate_hz: float) -> Take:
    """The take at another rate, without its fingers."""
    time_s = take.time_s[0] + np.arange(int((take.time_s[-1] - take.time_s[0]) * rate_hz) + 1) / rate_hz
    after = np.clip(np.searchsorted(take.time_s, time_s), 1, len(take.time_s) - 1)
    share = ((time_s - take.time_s[after - 1]) / (take.time_s[after] - take.time_s[after - 1]))[:, None]
    bodies = {
        name: BodyTrack(
            _between(track.poses[after - 1], track.poses[after], share),
            track.tracked[after - 1] & track.tracked[after],
        )
        for name, track in take.bodies.items()
    }
    return replace(take, rate_hz=rate_hz, time_s=time_s, bodies=bodies, fingers={})


def _between(before: Array, after: Array, share: Array) -> Array:
    """Poses a `share (n, 1)` of the way between poses that are near each other."""
    sign = np.where(np.sum(before[:, 3:] * after[:, 3:], axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    turned = quat_normalize((1.0 - share) * before[:, 3:] + share * sign * after[:, 3:])
    return np.concatenate([(1.0 - share) * before[:, :3] + share * after[:, :3], turned], axis=1)
