"""Smooth motions, and the white noise of trackers on them."""

import numpy as np

from manipnet.geometry import Array, quat_conjugate, quat_exp, quat_log, quat_multiply, quat_normalize

START = quat_normalize(np.array([0.1, -0.4, 0.2, 0.8]))
SPIN = np.array([0.5, 2.5, -0.7])


def at_rest(times_s: Array) -> Array:
    """A body that does not move, `(n, 7)`."""
    return np.tile([0.1, 1.0, -0.3, *START], (len(times_s), 1))


def hand_motion(times_s: Array) -> Array:
    """A hand that moves things about: swings of a decimetre at 1.5 Hz, smaller ones at 3 Hz, and turns; `(n, 7)`."""
    t = np.asarray(times_s)[:, None]
    swings = 0.1 * np.sin(2 * np.pi * 1.5 * t + [0.0, 1.0, 2.0]) + 0.01 * np.sin(2 * np.pi * 3.0 * t + [2.0, 0.0, 1.0])
    turns = 0.4 * np.sin(2 * np.pi * 1.0 * t + [1.0, 2.0, 0.0])
    return np.concatenate([swings, quat_multiply(quat_exp(turns), np.tile(START, (len(t), 1)))], axis=1)


def fall(times_s: Array) -> Array:
    """Constant acceleration and constant spin, `(n, 7)`."""
    t = np.asarray(times_s)[:, None]
    positions = np.array([1.0, -2.0, 0.5]) * t + 0.5 * np.array([3.0, -9.81, 1.0]) * t**2
    return np.concatenate([positions, quat_multiply(quat_exp(SPIN * t), np.tile(START, (len(t), 1)))], axis=1)


def shaken(poses: Array, position_m: float, rotation_rad: float, seed: int = 0) -> Array:
    """The poses `(n, 7)` with white noise of these standard deviations per axis."""
    noise = np.random.default_rng(seed).normal(size=(len(poses), 6)) * np.repeat([position_m, rotation_rad], 3)
    turned = quat_multiply(quat_exp(noise[:, 3:]), poses[:, 3:])
    return np.concatenate([poses[:, :3] + noise[:, :3], turned], axis=1)


def differences(poses: Array, truth: Array) -> tuple[Array, Array]:
    """Displacements and rotation vectors `(n, 3)` from the truth to some poses."""
    return poses[:, :3] - truth[:, :3], quat_log(quat_multiply(poses[:, 3:], quat_conjugate(truth[:, 3:])))
