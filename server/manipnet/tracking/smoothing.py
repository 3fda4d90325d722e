"""Takes the noise of a tracker out of poses by weighted quadratic regression in time.

The pose at an instant is that of a parabola, in position and in rotation vector, through the samples around it. Their
weights fall to zero at the ends of the kernel, so no sample enters or leaves with a jump. Where the future or the past
is missing, the kernel reaches further to the other side: with a long look-ahead it is symmetric, and without any it has
only the past and still does not lag behind a steady motion.

All bodies of an actor are smoothed by the same kernel, so that what a hand holds stays where it is in the hand. Where a
motion is too fast for the kernel, such as an impact, the samples miss the parabola by more than the noise; a narrower
kernel then takes its place, and at last the samples themselves. The method is local regression (Cleveland 1979) with a
bandwidth that follows the noise and the motion.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, kernel, stack_array
from manipnet.synthesis.rotations import slerp_into
from manipnet.tracking.noise import SPAN_S, USUAL_M, USUAL_RAD, Noise
from manipnet.tracking.parabola import fit_parabola

USUAL_HZ: Final = 120.0
HALF_WIDTH_S: Final = 0.08
"""Half the width of the kernel for noise of one unit at `USUAL_HZ`."""
GROWTH: Final = 0.5
"""Exponent of the noise in the width; the tremor that remains is then about the same whatever the noise is."""
WIDEST_S: Final = 0.15
NARROWEST: Final = 2.5
"""Bounds of the half width: in seconds, and in intervals of the stream."""
CLEAN_M: Final = 2e-4
CLEAN_RAD: Final = 0.2 * np.pi / 180.0
"""Up to this noise a stream is clean and is not changed."""
FULL: Final = 1.5
"""From this multiple of a clean stream's noise on, a stream is smoothed fully."""
NEAR: Final = 1.0 / 3.0
"""The share of the half width in which the samples are compared with the parabola."""
FITS: Final = 3.0
MISFITS: Final = 7.0
"""The samples near an instant miss the parabola by their mean. If the square of that is up to `FITS` times what noise
alone makes it, the instant is smoothed fully, and from `MISFITS` times on not at all."""
LEVELS: Final = 3
"""Where the parabola misfits, kernels of half the width are tried, and of a quarter."""
FOLLOW_TICKS: Final = 30.0
"""A change of the noise is followed with this time constant, so that nothing jumps."""
UNNOTICEABLE: Final = 1e-3

_quat, _pose, _ends = stack_array(4), stack_array(7), stack_array(2, 7)
_fits, _trusts = stack_array(LEVELS, 7), stack_array(LEVELS)


@dataclass(frozen=True, slots=True)
class Smoothing:
    """How the poses of all bodies of an actor are smoothed at a tick.

    A `share` of 0 leaves the poses as they are and 1 smooths them fully; `noise` is that of the noisiest body, as a
    multiple of `USUAL_M` or `USUAL_RAD`.
    """

    share: float
    noise: float
    half_width_s: float


class Smoother:
    """Follows the noise of the bodies of an actor and decides how they are smoothed."""

    def __init__(self) -> None:
        self._share = self._noise = self._half_width_s = 0.0

    def follow(self, noises: Iterable[Noise]) -> Smoothing | None:
        """The smoothing of the next tick, from the noise of each body; None if all are clean."""
        share = units = half_width_s = 0.0
        for noise in noises:
            # The median over a short time may be that of a fast motion, so that it must be larger to count.
            cleans = max(noise.position_m / CLEAN_M, noise.rotation_rad / CLEAN_RAD) * math.sqrt(noise.span_s / SPAN_S)
            excess = (cleans - 1.0) / (FULL - 1.0)
            if excess > 0.0:
                own = max(noise.position_m / USUAL_M, noise.rotation_rad / USUAL_RAD)
                width_s = HALF_WIDTH_S * (own * math.sqrt(USUAL_HZ * noise.interval_s)) ** GROWTH
                width_s = max(min(width_s, WIDEST_S), NARROWEST * noise.interval_s)
                share, units, half_width_s = max(share, min(excess, 1.0)), max(units, own), max(half_width_s, width_s)
        if self._share == 0.0:
            self._noise, self._half_width_s = units, half_width_s
        self._share += (share - self._share) / FOLLOW_TICKS
        if abs(self._share - share) < UNNOTICEABLE:
            self._share = share
        if share > 0.0:  # otherwise only the share fades
            self._noise += (units - self._noise) / FOLLOW_TICKS
            self._half_width_s += (half_width_s - self._half_width_s) / FOLLOW_TICKS
        return Smoothing(self._share, self._noise, self._half_width_s) if self._share else None


def smooth(times_s: Array, poses: Array, smoothing: Smoothing, at_s: Array, out: Array) -> None:
    """Turn the interpolated poses `out (m, 7)` at the rising instants `at_s (m,)` into the smoothed ones.

    `poses (n, 7)`, at rising `times_s (n,)`, are the samples that may be used. An instant before the first or after
    the last one gets the pose of that one.
    """
    _smooth(times_s, poses, smoothing.share, smoothing.noise, smoothing.half_width_s, at_s, out)


@kernel
def _smooth(times: Array, poses: Array, share, noise, half_width, at: Array, out: Array):
    ends = _ends()
    newest, after = len(times) - 1, 0
    for i in range(len(at)):
        t = min(max(at[i], times[0]), times[newest])
        while times[after] < t:
            after += 1
        before = after if times[after] == t else after - 1
        # Nothing is known of the motion in a gap, so that a straight line between its smoothed ends stays the guess.
        in_gap = times[after] - times[before] > half_width
        for end in range(2 if in_gap else 1):
            first = before + end
            for k in range(7):
                ends[end, k] = poses[first, k] if in_gap else out[i, k]
            last, instant = (first, times[first]) if in_gap else (after, t)
            _smooth_at(times, poses, first, last, instant, share, noise, half_width, ends[end])
        fraction = (t - times[before]) / (times[after] - times[before]) if in_gap else 0.0
        _blend_into(ends[0], ends[1], fraction, out[i])


@inner
def _blend_into(start: Array, end: Array, fraction, out: Array):
    """The pose a `fraction` of the way from one pose to another, into `out (7,)`, which may be the first."""
    if fraction == 0.0 or fraction == 1.0:
        for k in range(7):
            out[k] = end[k] if fraction else start[k]
        return
    rotation = _quat()
    for k in range(3):
        out[k] = start[k] + fraction * (end[k] - start[k])
    slerp_into(start[3:], end[3:], fraction, rotation)
    for k in range(4):
        out[3 + k] = rotation[k]


@inner
def _smooth_at(times: Array, poses: Array, before, after, t, share, noise, half_width, out: Array):
    """Smooth the pose `out (7,)` at the instant `t`; the samples `before` and `after` bracket it."""
    reach = 3.0 * half_width
    first, last = before, after
    while first > 0 and t - times[first - 1] < reach and times[first] - times[first - 1] <= half_width:
        first -= 1
    while last < len(times) - 1 and times[last + 1] - t < reach and times[last + 1] - times[last] <= half_width:
        last += 1
    fits, trusts, smoothed = _fits(), _trusts(), _pose()
    count = 0
    while count < LEVELS:
        width = half_width / (1 << count)
        behind, ahead = min(width, t - times[first]), min(width, times[last] - t)
        left, right = behind + 2.0 * (width - ahead), ahead + 2.0 * (width - behind)
        near = max(NEAR * width, 1.5 * (times[after] - times[before]))
        misfit = fit_parabola(times, poses, first, last, t, left, right, near, poses[before], noise, fits[count])
        trusts[count] = min(max((MISFITS - misfit) / (MISFITS - FITS), 0.0), 1.0)
        count += 1
        if trusts[count - 1] == 1.0:
            break
    for k in range(7):
        smoothed[k] = out[k]
    for level in range(count - 1, -1, -1):
        if trusts[level] > 0.0:
            _blend_into(smoothed, fits[level], trusts[level], smoothed)
    _blend_into(out, smoothed, share, out)
