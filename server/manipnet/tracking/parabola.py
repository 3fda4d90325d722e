"""A parabola in time through weighted poses, and whether the poses near an instant are on it."""

from typing import Final

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, stack_array, vector
from manipnet.synthesis.rotations import turn_quat_into
from manipnet.tracking.noise import USUAL_M, USUAL_RAD

AXES: Final = 6
"""Three of the position and three of the rotation vector."""
SMALL_SQUARE: Final = 0.04
"""The squared sine of half a turn below which the series of the arc sine is exact to 1e-10."""
_powers, _square_powers, _inverse, _sample = stack_array(5), stack_array(5), stack_array(3, 3), stack_array(AXES)
_sums, _slopes, _bends = stack_array(AXES), stack_array(AXES), stack_array(AXES)
_near_sums, _near_powers, _near_products = stack_array(AXES), stack_array(3), stack_array(3)


@inner
def fit_parabola(times: Array, poses: Array, first, last, t, left, right, near, reference: Array, noise, out: Array):
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
    per_left, per_right, per_near = 1.0 / max(left, 1e-9), 1.0 / max(right, 1e-9), 1.0 / near
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
