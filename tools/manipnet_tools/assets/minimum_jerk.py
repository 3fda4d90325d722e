"""Synthetic human motion: overlapping point-to-point movements of minimum jerk, and a tremor.

Each movement adds its displacement, eased in and out, to the previous motion. Two that overlap make a smooth curve past
the pose between them. Sources: Flash and Hogan 1985 (minimum jerk), Flash and Henis 1991 (superposition).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from manipnet.geometry import Array, quat_conjugate, quat_exp, quat_log, quat_multiply

_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


@dataclass(frozen=True)
class Move:
    """A movement to `pose (7,)`, over `[start_s, end_s]`."""

    start_s: float
    end_s: float
    pose: Array


def ease(time_s: Array, start_s: float, end_s: float) -> Array:
    """Values `(T,)` that rise from 0 to 1 with minimum jerk, at rest at both ends."""
    u = np.clip((time_s - start_s) / (end_s - start_s), 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


def superpose(time_s: Array, start: Array, moves: Sequence[Move]) -> Array:
    """Poses `(T, 7)` at `time_s (T,)` of a body that starts at rest at `start (7,)` and makes `moves` in order."""
    positions = np.tile(start[:3], (len(time_s), 1))
    rotations = np.tile(start[3:], (len(time_s), 1))
    before = start
    for move in moves:
        share = ease(time_s, move.start_s, move.end_s)[:, None]
        turn = quat_log(quat_multiply(quat_conjugate(before[3:]), move.pose[3:]))
        positions = positions + share * (move.pose[:3] - before[:3])
        rotations = quat_multiply(rotations, quat_exp(share * turn))
        before = move.pose
    return np.concatenate([positions, rotations], axis=1)


def tremor(time_s: Array, period_s: float, salt: int) -> Array:
    """Displacement `(T, 3)` of a hand that tries to be still, metres: slow sway and physiological tremor at 8 to 11 Hz.

    It repeats after `period_s`, and differs for each `salt`.
    """
    waves = [(hz, 6e-4 / (1.0 + 4.0 * hz)) for hz in (0.15, 0.32, 0.7, 1.3)] + [(hz, 2.5e-5) for hz in (8.1, 9.3, 10.7)]
    offset = np.zeros((len(time_s), 3))
    for k, (hz, amplitude_m) in enumerate(waves):
        for axis in range(3):
            phase = (7 * salt + 3 * k + axis) * _GOLDEN % 1.0
            cycles = max(round(hz * period_s * (1.0 + 0.07 * axis)), 1)
            offset[:, axis] += amplitude_m * np.sin(2.0 * np.pi * (cycles * time_s / period_s + phase))
    return offset
