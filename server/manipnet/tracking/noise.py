"""How noisy the tracking of a body is, estimated from its stream.

The fourth divided difference of five neighbouring samples removes every motion that is a cubic in time, so what it
leaves is noise; its median over the last seconds is not disturbed by the few moments in which the motion is too fast
for that. Divided differences allow for samples that are not evenly spaced.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, kernel, stack_array

USUAL_M: Final = 1e-3
USUAL_RAD: Final = 0.5 * np.pi / 180.0
"""The unit of noise: both move a fingertip, which is 0.11 m from the wrist, by a millimetre."""
SPAN_S: Final = 4.0
"""The estimate follows this much of the past."""
MOST: Final = 192
"""The number of differences that are enough for a median."""
LEAST: Final = 20
"""With fewer differences nothing is said."""
SAMPLES: Final = 5
LONGEST_S: Final = 0.1
"""Samples further apart than this are not compared, because the motion between them is not a cubic any more."""
MEDIAN_OF_NORMAL: Final = 0.6745
"""The median of the magnitude of a normal variable whose standard deviation is 1."""

_weights, _positions, _rotations = stack_array(SAMPLES), stack_array(3 * MOST), stack_array(3 * MOST)


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviations per axis of the noise of a body's poses, and the usual interval between its samples.

    It is estimated from the last `span_s`, at most `SPAN_S`.
    """

    position_m: float = 0.0
    rotation_rad: float = 0.0
    interval_s: float = 0.0
    span_s: float = 0.0


UNKNOWN: Final = Noise()
"""What is assumed before there are enough samples."""


def estimate_noise(times_s: Array, poses: Array) -> Noise:
    """The noise of the newest poses `(n, 7)` of a body, at rising times `(n,)`.

    All is zero as long as there are too few samples, and for streams slower than 40 Hz, whose motion cannot be told
    from noise.
    """
    first = int(np.searchsorted(times_s, times_s[-1] - SPAN_S))
    position_m, rotation_rad, interval_s = _estimate(times_s[first:], poses[first:])
    return Noise(position_m, rotation_rad, interval_s, times_s[-1] - times_s[first]) if interval_s else UNKNOWN


@kernel
def _estimate(times: Array, poses: Array):
    weights, positions, rotations = _weights(), _positions(), _rotations()
    sets = len(times) - SAMPLES + 1
    step = max(-(-sets // MOST), 1)
    count, spans = 0, 0.0
    for last in range(len(times) - 1, SAMPLES - 2, -step):
        first = last - SAMPLES + 1
        if times[last] - times[first] > LONGEST_S:
            continue
        _set_difference(times[first : last + 1], weights)
        for k in range(3):
            total = 0.0
            for i in range(SAMPLES):
                total += weights[i] * poses[first + i, k]
            positions[3 * count + k] = abs(total)
        x = y = z = w = 0.0
        for i in range(SAMPLES):
            x += weights[i] * poses[first + i, 3]
            y += weights[i] * poses[first + i, 4]
            z += weights[i] * poses[first + i, 5]
            w += weights[i] * poses[first + i, 6]
        # twice the vector part of the difference times the inverse of the middle rotation is a rotation vector
        q = poses[first + SAMPLES // 2, 3:]
        rotations[3 * count] = 2.0 * abs(x * q[3] - w * q[0] - y * q[2] + z * q[1])
        rotations[3 * count + 1] = 2.0 * abs(y * q[3] - w * q[1] - z * q[0] + x * q[2])
        rotations[3 * count + 2] = 2.0 * abs(z * q[3] - w * q[2] - x * q[1] + y * q[0])
        count += 1
        spans += times[last] - times[first]
    if count < LEAST:
        return 0.0, 0.0, 0.0
    position, rotation = _median(positions, 3 * count), _median(rotations, 3 * count)
    return position / MEDIAN_OF_NORMAL, rotation / MEDIAN_OF_NORMAL, spans / (count * (SAMPLES - 1))


@inner
def _set_difference(times: Array, weights: Array):
    """Weights of a divided difference that leave the standard deviation of white noise as it is."""
    squares = 0.0
    for i in range(SAMPLES):
        product = 1.0
        for j in range(SAMPLES):
            if j != i:
                product *= times[i] - times[j]
        weights[i] = 1.0 / product
        squares += weights[i] * weights[i]
    gain = 1.0 / np.sqrt(squares)
    for i in range(SAMPLES):
        weights[i] *= gain


@inner
def _median(values: Array, count):
    """The median of the first `count` values, none of which is negative, to a millionth of the largest."""
    low, high = 0.0, 0.0
    for i in range(count):
        high = max(high, values[i])
    for _ in range(30):
        middle = 0.5 * (low + high)
        below = 0
        for i in range(count):
            below += values[i] <= middle
        if 2 * below < count:
            low = middle
        else:
            high = middle
    return high
