"""Where a body will be: the future that a shorter look-ahead does not wait for.

A forecast is any function of the shape `body_track.Forecast`. The one here needs no training: the velocity of
the last moments, dying away, because hands and what they hold soon stop or turn.
"""

from typing import Final

import numpy as np

from manipnet.geometry import Array, quat_conjugate, quat_exp, quat_log, quat_multiply

FIT_S: Final = 0.06
"""The velocity is fitted to this much history: enough to average tracking noise, little enough to be
present.
"""
FADE_S: Final = 0.15
"""Time constant with which the velocity dies away; the motion ends at `FADE_S` times the present velocity."""


def damped_velocity(times_s: Array, poses: Array, future_s: Array) -> Array:
    """Continue a motion from its last pose with its fading velocity.

    `times_s (m,)` rising, `poses (m, 7)`, `future_s (n,)` at or after `times_s[-1]`; returns `(n, 7)`.
    Position and rotation alike; a history of one sample stands still.
    """
    recent = times_s >= times_s[-1] - FIT_S - 1e-6
    recent[-2:] = True
    t, p, q = times_s[recent] - times_s[-1], poses[recent, :3], poses[recent, 3:]
    last = poses[-1]
    turned = quat_log(quat_multiply(q, quat_conjugate(last[3:])))
    weight = np.sum(t * t)
    velocity = np.zeros(6) if weight <= 0.0 else t @ np.concatenate([p - last[:3], turned], axis=1) / weight
    reach = FADE_S * -np.expm1(-(future_s - times_s[-1]) / FADE_S)
    moved = reach[:, None] * velocity
    return np.concatenate([last[:3] + moved[:, :3], quat_multiply(quat_exp(moved[:, 3:]), last[3:])], axis=1)
