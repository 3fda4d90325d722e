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

    def __init__(self) -> None:
        self._times = np.empty(2 * KEEP)
        self._poses = np.empty((2 * KEEP, 7))
        self._count = 0
        self.seen_s = -np.inf
        """Newest instant at which the body was in a frame, tracked or not."""
        self.noise = UNKNOWN
        """The noise of the newest samples."""
        self._estimated_s = -np.inf

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
        at = self._place(t_s)
        if at is None:
            return False
        if self._count == len(self._times):
            self._forget()
            at -= KEEP
            if at < 0:
                return False
        if at < self._count:
            self._times[at + 1 : self._count + 1] = self._times[at : self._count]
            self._poses[at + 1 : self._count + 1] = self._poses[at : self._count]
        self._times[at], self._poses[at] = t_s, pose
        self._count += 1
        self._align(at)
        if t_s - self._estimated_s >= NOISE_EVERY_S:
            self._estimated_s, self.noise = t_s, estimate_noise(self.times, self.poses)
        return True

    def _place(self, t_s: float) -> int | None:
        """Where a sample of this time belongs; None if there is one at nearly the same instant."""
        count = self._count
        if not count or t_s - self._times[count - 1] >= MIN_SPACING_S:
            return count
        at = int(np.searchsorted(self.times, t_s))
        near = (neighbour for neighbour in (at - 1, at) if 0 <= neighbour < count)
        return None if any(abs(self._times[k] - t_s) < MIN_SPACING_S for k in near) else at

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
        return self.noise if self._count and t_s - self._times[self._count - 1] < FORGET_S else UNKNOWN

    def _align(self, at: int) -> None:
        """Keep neighbouring quaternions in one hemisphere, because trackers may flip their signs."""
        if at and self._poses[at, 3:] @ self._poses[at - 1, 3:] < 0.0:
            self._poses[at, 3:] *= -1.0
        for i in range(at + 1, self._count):
            if self._poses[i, 3:] @ self._poses[i - 1, 3:] >= 0.0:
                break
            self._poses[i, 3:] *= -1.0

    def _forget(self) -> None:
        self._times[:KEEP] = self._times[KEEP:].copy()
        self._poses[:KEEP] = self._poses[KEEP:].copy()
        self._count = KEEP


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
    poses, ages = np.empty((len(tracks), len(times_s), 7)), []
    for row, track in zip(poses, tracks, strict=True):
        known, age_s = _resample(track.times, track.poses, times_s, present_s, until_s, row)
        ages.append(age_s)
        samples = track.times[:known], track.poses[:known]
        if smoothing is not None:
            smooth(*samples, smoothing, times_s, row)
        if forecast is None or times_s[-1] <= (last_s := track.times[known - 1] + TIME_TOLERANCE_S):
            continue
        beyond = int(np.searchsorted(times_s, last_s, side="right"))
        if smoothing is None:
            row[beyond:] = forecast(*samples, times_s[beyond:])
        else:
            fit_s = FIT_S + smoothing.share * (smoothing.half_width_s - FIT_S)
            history = _smoothed_history(*samples, smoothing, fit_s)
            row[beyond:] = forecast(*history, times_s[beyond:], fit_s, smoothing.share)
    return poses, ages


def _smoothed_history(times_s: Array, poses: Array, smoothing: Smoothing, length_s: float) -> tuple[Array, Array]:
    """The newest moments of a motion as evenly spaced samples: their times `(n,)` and poses `(n, 7)`."""
    at_s = times_s[-1] + length_s * HISTORY_STEPS
    smoothed = np.empty((len(at_s), 7))
    _resample(times_s, poses, at_s, at_s[-1], at_s[-1], smoothed)
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
def _resample(times: Array, poses: Array, at: Array, present_s: float, until_s: float, out: Array):
    """Write the poses at the rising instants `at`, interpolated between the rising `times`, into `out`.

    The poses stand at both ends. Returns the number of samples up to the first one at or after `until_s`, which are
    those that may be used, and the age of the newest sample at `present_s`, which is infinite if there is none.
    """
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
    return known, age_s
