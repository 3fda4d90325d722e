"""Forecasts where a body will be, for the future that a shorter look-ahead does not wait for.

Any function of the type `pose_buffer.Forecast` can take the place of the one here, which needs no training: it
continues with the velocity of the last moments, which fades, because hands and what they hold soon stop or turn. A
linear predictor that was fitted to captured takes is no better (`benchmarks/forecasts.py`, `docs/results.md`).
"""

from typing import Final

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, kernel, vector

FIT_S: Final = 0.035
"""The velocity is fitted to this much history: long enough to average tracking noise, short enough to be current."""
FADE_S: Final = 0.2
FADE_SPIN_S: Final = 0.12
"""Time constants of the fading velocity and spin; in all, a motion goes on by this time multiplied by its velocity."""


def damped_velocity(times_s: Array, poses: Array, future_s: Array) -> Array:
    """Continue a motion, in position and rotation, from its last pose with a fading velocity.

    `times_s (m,)` rise, `poses (m, 7)` are in the world, and `future_s (n,)` are at or after `times_s[-1]`. Returns
    world poses `(n, 7)`. A history of one sample stands still.
    """
    out = np.empty((len(future_s), 7))
    _damped_velocity(times_s, poses, future_s, out)
    return out


@inner
def _turn_since(q, last, out):
    """Write the shortest rotation vector from the unit quaternion `last` to `q` into `out (3,)`."""
    w = q[0] * last[0] + q[1] * last[1] + q[2] * last[2] + q[3] * last[3]
    x = q[0] * last[3] - q[3] * last[0] - q[1] * last[2] + q[2] * last[1]
    y = q[1] * last[3] - q[3] * last[1] - q[2] * last[0] + q[0] * last[2]
    z = q[2] * last[3] - q[3] * last[2] - q[0] * last[1] + q[1] * last[0]
    sine = np.sqrt(x * x + y * y + z * z)
    angle = 2.0 * np.arctan2(sine, abs(w))
    gain = (2.0 if sine < 1e-9 else angle / sine) * (-1.0 if w < 0.0 else 1.0)
    out[0], out[1], out[2] = gain * x, gain * y, gain * z


@inner
def _turned_into(turn, q, out):
    """Write the unit quaternion `q`, turned by a rotation vector, into `out (4,)`."""
    angle = np.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    gain = 0.5 if angle < 1e-9 else np.sin(0.5 * angle) / angle
    x, y, z, w = gain * turn[0], gain * turn[1], gain * turn[2], np.cos(0.5 * angle)
    out[0] = w * q[0] + x * q[3] + y * q[2] - z * q[1]
    out[1] = w * q[1] - x * q[2] + y * q[3] + z * q[0]
    out[2] = w * q[2] + x * q[1] - y * q[0] + z * q[3]
    out[3] = w * q[3] - x * q[0] - y * q[1] - z * q[2]


@kernel
def _damped_velocity(times, poses, future, out):
    newest = len(times) - 1
    last, turn, velocity, spin, weight = poses[newest], vector(), vector(), vector(), 0.0
    for k in range(3):
        velocity[k] = spin[k] = 0.0
    for i in range(newest - 1, -1, -1):
        t = times[i] - times[newest]
        if t < -FIT_S - 1e-6 and i < newest - 1:
            break
        _turn_since(poses[i, 3:], last[3:], turn)
        weight += t * t
        for k in range(3):
            velocity[k] += t * (poses[i, k] - last[k])
            spin[k] += t * turn[k]
    for n in range(len(future)):
        ahead = future[n] - times[newest]
        reach, turned = FADE_S * -np.expm1(-ahead / FADE_S), FADE_SPIN_S * -np.expm1(-ahead / FADE_SPIN_S)
        for k in range(3):
            out[n, k] = last[k] + (reach * velocity[k] / weight if weight > 0.0 else 0.0)
            turn[k] = turned * spin[k] / weight if weight > 0.0 else 0.0
        _turned_into(turn, last[3:], out[n, 3:])
