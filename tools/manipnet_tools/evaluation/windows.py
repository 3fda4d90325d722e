"""Half seconds of motion as rows of numbers, for comparing two sets of motions.

Positions enter without the window's own mean, or the set of poses of a take would be recognised instead of the way they
are reached. All motions are low-passed alike first, because otherwise the tremor of the capture would tell.
"""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.signal import butter, sosfiltfilt

from manipnet.geometry import Array, Side, quat_exp, quat_rotate
from manipnet.synthesis.hand.hand import Hand
from manipnet.tracking.tick import TICK_HZ
from manipnet_tools.evaluation.cases import Case
from manipnet_tools.evaluation.metrics import SETTLE_FRAMES

WINDOW_FRAMES, STEP_FRAMES = 30, 15
LOW_PASS_HZ = 5.0
FAR_M = 0.05
"""Larger gaps count as this one."""
NOISE_HZ, NOISE_DEGREES = 2.0, 3.0
_STILL = 1e-3
"""Added to speeds (m/s) and accelerations (m/s²) before their logarithm is taken."""


def window_rows(case: Case, side: Side, positions: Array) -> Array:
    """The windows of a hand in the order of time, `(N, D)`; the first second is left out, and `N` may be 0."""
    if len(positions) < SETTLE_FRAMES + WINDOW_FRAMES:
        return np.empty((0, 4 * (case.hand.joint_count - 1) + 2 * len(case.hand.radii)))
    gap = case.gaps_of(side, positions).gap[SETTLE_FRAMES:]
    return _rows(_low_passed(positions[SETTLE_FRAMES:]), gap)


def _low_passed(positions: Array) -> Array:
    return np.asarray(sosfiltfilt(butter(2, LOW_PASS_HZ, fs=TICK_HZ, output="sos"), positions, axis=0))


def _rows(positions: Array, gap: Array) -> Array:
    velocity = np.gradient(positions[:, 1:], axis=0) * TICK_HZ  # the wrist stands still in its own frame
    speed = np.linalg.norm(velocity, axis=2)
    acceleration = np.linalg.norm(np.gradient(velocity, axis=0) * TICK_HZ, axis=2)
    spread = _windows(positions[:, 1:].reshape(len(positions), -1)).std(axis=2).reshape(-1, *speed.shape[1:], 3)
    near = _windows(np.minimum(gap, FAR_M))
    return np.concatenate(
        [
            np.linalg.norm(spread, axis=2),
            np.log(_windows(speed).mean(axis=2) + _STILL),
            np.log(_windows(speed).max(axis=2) + _STILL),
            np.log(_windows(acceleration).mean(axis=2) + _STILL),
            near.mean(axis=2),
            near.std(axis=2),
        ],
        axis=1,
    )


def _windows(values: Array) -> Array:
    """`(T, D)` to `(N, D, 30)`."""
    return sliding_window_view(values, WINDOW_FRAMES, axis=0)[::STEP_FRAMES]


def shaken(hand: Hand, positions: Array, rng: np.random.Generator) -> Array:
    """The motion `(T, J, 3)` with every finger joint bent by slow noise of 3° (standard deviation).

    A motion shorter than a window is returned as it is, because it is never compared.
    """
    if len(positions) < WINDOW_FRAMES:
        return positions
    slow = butter(2, NOISE_HZ, fs=TICK_HZ, output="sos")
    shaken = positions.copy()
    for finger in hand.fingers:
        for k, joint in enumerate(finger[:-1]):
            noise = np.asarray(sosfiltfilt(slow, rng.normal(size=len(positions))))
            bend = np.radians(NOISE_DEGREES) * noise / noise.std()
            turn = quat_exp(bend[:, None] * np.array([0.0, 1.0, 0.0]))
            beyond, pivot = list(finger[k + 1 :]), shaken[:, joint, None]
            shaken[:, beyond] = pivot + quat_rotate(turn[:, None], shaken[:, beyond] - pivot)
    return shaken
