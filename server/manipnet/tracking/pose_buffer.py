"""The recent poses of one streamed body, and their interpolation by time."""

from collections.abc import Sequence
from typing import Final, Protocol

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, kernel
from manipnet.synthesis.rotations import slerp_into
from manipnet.tracking.forecast import FIT_S
from manipnet.tracking.noise import UNKNOWN, Noise, estimate_noise
from manipnet.tracking.smoothing import Smoothing, smooth

KEEP: Final = 1024
"""Number of newest samples that are kept: more than 2 s at the highest accepted rate."""
MIN_SPACING_S: Final = 0.0015
"""A sample closer than this to another one is a duplicate, because no tracker is that fast."""
TIME_TOLERANCE_S: Final = 1e-6
"""Two times this close are the same instant, because times are sums of rounded fractions."""
NOISE_EVERY_S: Final = 0.25
"""How often the noise of a body is estimated again."""
FORGET_S: Final = 1.0
"""The noise of a body that has been lost for this long no longer counts."""
HISTORY_STEPS: Final = np.linspace(-1.0, 0.0, 5)
"""Instants of the smoothed history that is given to a forecast, from its start to its end."""


class Forecast(Protocol):
    """Continues a motion beyond its history."""

    def __call__(
        self, times_s: Array, poses: Array, future_s: Array, fit_s: float = ..., doubt: float = ..., /
    ) -> Array:
        """From poses `(m, 7)` at `times_s (m,)` to poses `(n, 7)` at `future_s (n,)`, which are not before the last.

        The last `fit_s` of the history are the current motion. If the tracker was noisy, they are longer than usual,
        and a `doubt` up to 1 says that slow motion may be noise.
        """
        ...


class PoseBuffer:
    """Poses of one body in the order of its sender's clock; samples may arrive late or in the wrong order."""

    def __init__(self, turn: float = 0.0) -> None:
        """The noise is estimated a share `turn` of `NOISE_EVERY_S` after the first sample, and then again and again."""
        self._times = np.empty(2 * KEEP)
        self._poses = np.empty((2 * KEEP, 7))
        self._count = 0
        self.seen_s = -np.inf
        """Newest instant at which the body was in a frame, tracked or not."""
        self.newest_s = -np.inf
        """Instant of the newest tracked sample."""
        self.noise = UNKNOWN
        """The noise of the newest samples."""
        self._turn, self._estimate_s = turn, -np.inf

    @property
    def times(self) -> Array:
        """Sample times `(n,)` in seconds, rising."""
        return self._times[: self._count]

    @property
    def poses(self) -> Array:
        """World poses `(n, 7)` at `times`; neighbouring quaternions are in the same hemisphere."""
        return self._poses[: self._count]

    def add(self, t_s: float, pose: Array | Sequence[float]) -> bool:
        """Insert a tracked pose; returns False, and changes nothing, if there is one at nearly the same instant."""
        self._count, added = _insert(self._times, self._poses, self._count, t_s, np.asarray(pose, np.float64))
        if not added:
            return False
        if self._count == 1:
            self._estimate_s = t_s + self._turn * NOISE_EVERY_S
        self.newest_s = max(self.newest_s, t_s)
        if t_s >= self._estimate_s:
            self._estimate_s, self.noise = t_s + NOISE_EVERY_S, estimate_noise(self.times, self.poses)
        return True

    def interval_s(self) -> float:
        """Median spacing of the newest samples; infinite before the second sample."""
        newest = self.times[-16:]
        return float(np.median(np.diff(newest))) if len(newest) > 1 else np.inf

    def age_s(self, t_s: float) -> float:
        """Time since the newest tracked sample at or before `t_s`; infinite if there is none."""
        before = int(np.searchsorted(self.times, t_s + TIME_TOLERANCE_S))
        return max(t_s - float(self._times[before - 1]), 0.0) if before else np.inf

    def noise_at(self, t_s: float) -> Noise:
        """The noise of the newest samples, which is unknown if the body has been lost for long at `t_s`."""
        return self.noise if t_s - self.newest_s < FORGET_S else UNKNOWN

    def resample(self, times_s: Array, present_s: float, until_s: float, out: Array) -> tuple[int, float, float]:
        """Interpolate the poses at rising `times_s (n,)` into `out (n, 7)`.

        Returns how many samples may be used, which are those up to the first one at or after `until_s`, the instant of
        the last of them, and the age at `present_s` of the newest one before it, which is infinite if there is none.
        """
        known, last_s, age_s = _resample(self._times, self._poses, self._count, times_s, present_s, until_s, out)
        return known, float(last_s), float(age_s)


def sample(
    tracks: Sequence[PoseBuffer],
    times_s: Array,
    present_s: float,
    until_s: float,
    forecast: Forecast | None,
    smoothing: Smoothing | None = None,
) -> tuple[Array, list[float]]:
    """World poses `(len(tracks), n, 7)` of non-empty tracks at rising `times_s (n,)`, and their ages at `present_s`.

    Positions are interpolated linearly and rotations on the shortest arc. Only samples up to `until_s` are used, and
    the one that brackets it. Before the first sample, its pose stands; after the last one, `forecast` continues the
    motion, or the last pose stands if there is no `forecast`. With `smoothing`, poses and forecast are those of the
    smoothed motion.
    """
    poses, ages, end_s = np.empty((len(tracks), len(times_s), 7)), [], float(times_s[-1])
    for row, track in zip(poses, tracks, strict=True):
        known, last_s, age_s = track.resample(times_s, present_s, until_s, row)
        ages.append(age_s)
        if smoothing is not None:
            smooth(track.times[:known], track.poses[:known], smoothing, times_s, row)
        if forecast is not None and end_s > last_s + TIME_TOLERANCE_S:
            _continue(track.times[:known], track.poses[:known], forecast, smoothing, times_s, row)
    return poses, ages


def _continue(
    known_s: Array, poses: Array, forecast: Forecast, smoothing: Smoothing | None, times_s: Array, row: Array
) -> None:
    """Replace the poses `row (n, 7)` at the `times_s (n,)` that are after the last known sample by a forecast."""
    beyond = int(np.searchsorted(times_s, known_s[-1] + TIME_TOLERANCE_S, side="right"))
    if smoothing is None:
        row[beyond:] = forecast(known_s, poses, times_s[beyond:])
    else:
        fit_s = FIT_S + smoothing.share * (smoothing.half_width_s - FIT_S)
        history = _smoothed_history(known_s, poses, smoothing, fit_s)
        row[beyond:] = forecast(*history, times_s[beyond:], fit_s, smoothing.share)


def _smoothed_history(times_s: Array, poses: Array, smoothing: Smoothing, length_s: float) -> tuple[Array, Array]:
    """The newest moments of a motion as evenly spaced samples: their times `(n,)` and poses `(n, 7)`."""
    at_s = times_s[-1] + length_s * HISTORY_STEPS
    smoothed = np.empty((len(at_s), 7))
    _resample(times_s, poses, len(times_s), at_s, at_s[-1], at_s[-1], smoothed)
    smooth(times_s, poses, smoothing, at_s, smoothed)
    return at_s, smoothed


@inner
def _count_before(times: Array, t_s: float):
    """Number of the rising `times` that are before an instant."""
    low, high = 0, len(times)
    while low < high:
        middle = (low + high) >> 1
        if times[middle] < t_s:
            low = middle + 1
        else:
            high = middle
    return low


@kernel
def _insert(times: Array, poses: Array, count: int, t_s: float, pose: Array):
    """Insert a `pose (7,)` among the first `count` of `times (N,)` and `poses (N, 7)`, unless one is at nearly the same
    instant; if there is no room, the older half is forgotten first.

    Returns how many there are then, and whether the pose is one of them. Neighbouring quaternions are kept in one
    hemisphere, because trackers may flip their signs.
    """
    at = count
    if count > 0 and t_s - times[count - 1] < MIN_SPACING_S:
        at = _count_before(times[:count], t_s)
        for near in range(max(at - 1, 0), min(at + 1, count)):
            if abs(times[near] - t_s) < MIN_SPACING_S:
                return count, False
    if count == len(times):
        count -= KEEP
        at -= KEEP
        for i in range(count):
            _move(times, poses, i + KEEP, i)
        if at < 0:
            return count, False
    for i in range(count, at, -1):
        _move(times, poses, i - 1, i)
    times[at] = t_s
    for k in range(7):
        poses[at, k] = pose[k]
    count += 1
    for i in range(max(at, 1), count):
        cosine = 0.0
        for k in range(3, 7):
            cosine += poses[i, k] * poses[i - 1, k]
        if cosine < 0.0:
            for k in range(3, 7):
                poses[i, k] = -poses[i, k]
        elif i > at:
            break
    return count, True


@inner
def _move(times: Array, poses: Array, start: int, end: int):
    times[end] = times[start]
    for k in range(7):
        poses[end, k] = poses[start, k]


@kernel
def _resample(times: Array, poses: Array, count: int, at: Array, present_s: float, until_s: float, out: Array):
    """`PoseBuffer.resample` of the first `count` samples. The poses stand at both ends."""
    times = times[:count]
    known = min(_count_before(times, until_s - TIME_TOLERANCE_S) + 1, len(times))
    before = _count_before(times, present_s + TIME_TOLERANCE_S)
    age_s = max(present_s - times[before - 1], 0.0) if before > 0 else np.inf
    after = _count_before(times[:known], at[0])
    for i in range(len(at)):
        while after < known and times[after] <= at[i]:
            after += 1
        if after == 0 or after == known:
            for k in range(7):
                out[i, k] = poses[min(after, known - 1), k]
            continue
        before = after - 1
        fraction = (at[i] - times[before]) / (times[after] - times[before])
        for k in range(3):
            out[i, k] = poses[before, k] + fraction * (poses[after, k] - poses[before, k])
        slerp_into(poses[before, 3:], poses[after, 3:], fraction, out[i, 3:])
    return known, times[known - 1], age_s
