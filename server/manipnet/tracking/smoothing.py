"""Takes the noise of a tracker out of poses by weighted quadratic regression in time.

The pose at an instant is that of a parabola, in position and in rotation vector, through the samples around it. Their
weights fall to zero at the ends of the kernel, so no sample enters or leaves with a jump. Where the future or the past
is missing, the kernel reaches further to the other side: with a long look-ahead it is symmetric, and without any it has
only the past and still does not lag behind a steady motion.

All bodies of an actor are smoothed by the same kernel, so that what a hand holds stays where it is in the hand. Where a
motion is too fast for the kernel, such as an impact, the samples miss the parabola by more than the noise and are left
as they are. The method is local regression (Cleveland 1979) with a bandwidth that follows the noise.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, kernel, stack_array, vector
from manipnet.synthesis.rotations import slerp_into, turn_quat_into
from manipnet.tracking.noise import SPAN_S, Noise

USUAL_M: Final = 1e-3
USUAL_RAD: Final = 0.5 * np.pi / 180.0
"""The unit of noise: both move a fingertip, which is 0.11 m from the wrist, by a millimetre."""
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
"""Up to this noise a stream is clean and is not changed. A short stream may seem to have more, when it begins fast."""
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

AXES: Final = 6
"""Three of the position and three of the rotation vector."""
SMALL_SQUARE: Final = 0.04
"""The squared sine of half a turn below which the series of the arc sine is exact to 1e-10."""
_quat, _pose, _sample = stack_array(4), stack_array(7), stack_array(AXES)
_ends, _fits, _trusts = stack_array(2, 7), stack_array(LEVELS, 7), stack_array(LEVELS)
_powers, _square_powers, _inverse = stack_array(5), stack_array(5), stack_array(3, 3)
_sums, _slopes, _bends = stack_array(AXES), stack_array(AXES), stack_array(AXES)
_near_sums, _near_powers, _near_products = stack_array(AXES), stack_array(3), stack_array(3)


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
        misfit = _fit_parabola(times, poses, first, last, t, left, right, near, poses[before], noise, fits[count])
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


@inner
def _fit_parabola(times: Array, poses: Array, first, last, t, left, right, near, reference: Array, noise, out: Array):
    """The pose at the instant `t` of a parabola through weighted samples about the pose `reference`, into `out (7,)`.

    The weights reach `left` into the past and `right` into the future. Returns the square of the mean residual of the
    samples up to `near`, as a multiple of what it is by noise alone; it is infinite if there are too few samples.
    """
    powers, square_powers, inverse, sample = _powers(), _square_powers(), _inverse(), _sample()
    turn = vector()
    sums, slopes, bends = _sums(), _slopes(), _bends()
    near_sums, near_powers, near_products, near_squares = _near_sums(), _near_powers(), _near_products(), 0.0
    for j in range(5):
        powers[j] = square_powers[j] = 0.0
    for j in range(3):
        near_powers[j] = near_products[j] = 0.0
    for k in range(AXES):
        sums[k] = slopes[k] = bends[k] = near_sums[k] = 0.0
    scale = 1.0 / (left + right)
    per_left, per_right, per_near = 1.0 / left, 1.0 / max(right, 1e-9), 1.0 / near
    for i in range(first, last + 1):
        tau = times[i] - t
        u = tau * per_left if tau < 0.0 else tau * per_right
        if u <= -1.0 or u >= 1.0:
            continue
        weight = (1.0 - u * u) ** 2
        x = scale * tau
        power = weight
        for j in range(5):
            powers[j] += power
            square_powers[j] += weight * power
            power *= x
        _difference_into(reference, poses[i], sample)
        for k in range(AXES):
            value = weight * sample[k]
            sums[k] += value
            slopes[k] += value * x
            bends[k] += value * (x * x)
        v = tau * per_near
        if -1.0 < v < 1.0:
            near_weight = (1.0 - v * v) ** 2
            near_squares += near_weight * near_weight
            power = near_weight
            for j in range(3):
                near_powers[j] += power
                near_products[j] += weight * power
                power *= x
            for k in range(AXES):
                near_sums[k] += near_weight * sample[k]
    if not _invert_moments(powers, inverse):
        return np.inf
    squares = 0.0
    for k in range(AXES):
        constant = inverse[0, 0] * sums[k] + inverse[0, 1] * slopes[k] + inverse[0, 2] * bends[k]
        slope = inverse[1, 0] * sums[k] + inverse[1, 1] * slopes[k] + inverse[1, 2] * bends[k]
        bend = inverse[2, 0] * sums[k] + inverse[2, 1] * slopes[k] + inverse[2, 2] * bends[k]
        residual = near_sums[k] - constant * near_powers[0] - slope * near_powers[1] - bend * near_powers[2]
        squares += residual * residual
        sample[k] = constant
    for k in range(3):
        out[k], turn[k] = reference[k] + USUAL_M * sample[k], USUAL_RAD * sample[3 + k]
    turn_quat_into(turn, reference[3:], out[3:])
    expected = _near_variance(inverse, square_powers, near_powers, near_products, near_squares)
    return squares / (AXES * noise * noise * expected) if expected > 1e-6 * near_squares else np.inf


@inner
def _near_variance(inverse: Array, square_powers: Array, near_powers: Array, near_products: Array, near_squares):
    """The variance of the weighted sum of the residuals near the instant, from white noise of variance 1."""
    gains = vector()
    for i in range(3):
        gains[i] = 0.0
        for j in range(3):
            gains[i] += inverse[i, j] * near_powers[j]
    variance = near_squares
    for i in range(3):
        variance -= 2.0 * gains[i] * near_products[i]
        for j in range(3):
            variance += gains[i] * square_powers[i + j] * gains[j]
    return variance


@inner
def _difference_into(reference: Array, pose: Array, out: Array):
    """From the pose `reference` to `pose`: displacement and rotation vector in units of noise, into `out (6,)`.

    Small turns, which are nearly all, take the series of the arc sine, which is ten times as fast as its function.
    """
    qx, qy, qz, qw = reference[3], reference[4], reference[5], reference[6]
    px, py, pz, pw = pose[3], pose[4], pose[5], pose[6]
    w = pw * qw + px * qx + py * qy + pz * qz
    x = px * qw - pw * qx - py * qz + pz * qy
    y = py * qw - pw * qy - pz * qx + px * qz
    z = pz * qw - pw * qz - px * qy + py * qx
    square = x * x + y * y + z * z
    if square < SMALL_SQUARE:
        gain = 2.0 + square * (1 / 3 + square * (3 / 20 + square * (5 / 56 + square * (35 / 576 + square * 63 / 1408))))
    else:
        gain = 2.0 * np.arctan2(np.sqrt(square), abs(w)) / np.sqrt(square)
    gain *= (1.0 if w > 0.0 else -1.0) / USUAL_RAD
    for k in range(3):
        out[k] = (pose[k] - reference[k]) * (1.0 / USUAL_M)
    out[3], out[4], out[5] = gain * x, gain * y, gain * z


@inner
def _invert_moments(m: Array, out: Array):
    """Invert the symmetric matrix of the moments `m[i + j]`, into `out (3, 3)`; False if it is singular."""
    a, b, c = m[2] * m[4] - m[3] * m[3], m[2] * m[3] - m[1] * m[4], m[1] * m[3] - m[2] * m[2]
    determinant = m[0] * a + m[1] * b + m[2] * c
    if determinant <= 1e-12 * m[0] ** 3:
        return False
    out[0, 0], out[0, 1], out[0, 2] = a / determinant, b / determinant, c / determinant
    out[1, 1] = (m[0] * m[4] - m[2] * m[2]) / determinant
    out[1, 2] = (m[1] * m[2] - m[0] * m[3]) / determinant
    out[2, 2] = (m[0] * m[2] - m[1] * m[1]) / determinant
    out[1, 0], out[2, 0], out[2, 1] = out[0, 1], out[0, 2], out[1, 2]
    return True
