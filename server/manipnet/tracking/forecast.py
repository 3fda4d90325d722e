"""Forecasts where a body will be, for the future that a shorter look-ahead does not wait for.

Any function of the type `pose_buffer.Forecast` can take the place of the one here, which needs no training: it
continues with the velocity of the last moments, which fades, because hands and what they hold soon stop or turn. A
linear predictor that was fitted to captured takes is no better (`benchmarks/forecasts.py`, `docs/results.md`).
"""

from typing import Final

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, kernel, vector
from manipnet.synthesis.rotations import rotation_vector_between_into, turn_quat_into

FIT_S: Final = 0.035
"""The velocity is fitted to this much history, which is short enough to be current; noisy histories need more of it."""
DOUBTFUL_M_S: Final = 0.08
DOUBTFUL_RAD_S: Final = 0.7
"""With noise, a body that seems to move as slowly as this may as well stand still, so half of the velocity counts."""
FADE_S: Final = 0.2
FADE_SPIN_S: Final = 0.12
"""Time constants of the fading velocity and spin; in all, a motion goes on by this time multiplied by its velocity."""


def damped_velocity(times_s: Array, poses: Array, future_s: Array, fit_s: float = FIT_S, doubt: float = 0.0) -> Array:
    """Continue a motion, in position and rotation, from its last pose with a fading velocity.

    `times_s (m,)` rise, `poses (m, 7)` are in the world, and `future_s (n,)` are at or after `times_s[-1]`. The
    velocity is fitted to the last `fit_s`. A `doubt` from 0 to 1 says how far slow motion may be noise. Returns world
    poses `(n, 7)`. A history of one sample stands still.
    """
    out = np.empty((len(future_s), 7))
    _damped_velocity(times_s, poses, future_s, fit_s, doubt, out)
    return out


@kernel
def _damped_velocity(times: Array, poses: Array, future: Array, fit_s, doubt, out: Array):
    newest = len(times) - 1
    last, turn, velocity, spin, weight = poses[newest], vector(), vector(), vector(), 0.0
    for k in range(3):
        velocity[k] = spin[k] = 0.0
    for i in range(newest - 1, -1, -1):
        t = times[i] - times[newest]
        if t < -fit_s - 1e-6 and i < newest - 1:
            break
        rotation_vector_between_into(last[3:], poses[i, 3:], turn)
        weight += t * t
        for k in range(3):
            velocity[k] += t * (poses[i, k] - last[k])
            spin[k] += t * turn[k]
    belief = _belief(velocity, weight, doubt * DOUBTFUL_M_S), _belief(spin, weight, doubt * DOUBTFUL_RAD_S)
    for n in range(len(future)):
        ahead = future[n] - times[newest]
        reach = belief[0] * FADE_S * -np.expm1(-ahead / FADE_S)
        turned = belief[1] * FADE_SPIN_S * -np.expm1(-ahead / FADE_SPIN_S)
        for k in range(3):
            out[n, k] = last[k] + (reach * velocity[k] / weight if weight > 0.0 else 0.0)
            turn[k] = turned * spin[k] / weight if weight > 0.0 else 0.0
        turn_quat_into(turn, last[3:], out[n, 3:])


@inner
def _belief(momentum: Array, weight, doubtful):
    """How much of the velocity `momentum (3,)` over `weight` counts, if one of the size `doubtful` counts half."""
    doubtful *= weight
    square = momentum[0] ** 2 + momentum[1] ** 2 + momentum[2] ** 2
    return square / (square + doubtful * doubtful) if doubtful > 0.0 else 1.0
