"""Least squares for fingers that all move with one wrist: each has four unknowns, and the wrist three.

Every equation is added to its finger's normal equations and to the wrist's. The fingers are eliminated first (their
Schur complement), so that no system is larger than 4 x 4.
"""

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner
from manipnet.synthesis.hand.hand import CHAIN_LENGTH, Chains, Skeleton
from manipnet.synthesis.ik.chains import angle_moves


@inner
def solve_finger(square: Array, sides: Array):
    """Cholesky solve of a positive definite 4 x 4 system for the four right-hand sides `sides (4, 4)`, in place."""
    for i in range(CHAIN_LENGTH):
        for j in range(i + 1):
            total = square[i, j]
            for k in range(j):
                total -= square[i, k] * square[j, k]
            square[i, j] = np.sqrt(max(total, 1e-12)) if i == j else total / square[j, j]
    for c in range(4):
        for i in range(CHAIN_LENGTH):
            for k in range(i):
                sides[i, c] -= square[i, k] * sides[k, c]
            sides[i, c] /= square[i, i]
        for i in range(CHAIN_LENGTH - 1, -1, -1):
            for k in range(i + 1, CHAIN_LENGTH):
                sides[i, c] -= square[k, i] * sides[k, c]
            sides[i, c] /= square[i, i]


@inner
def lever_row(
    skeleton: Skeleton, chains: Chains, finger: int, bone: int, positions: Array, axes: Array, p: Array, n: Array, row
):
    """How far a point `p` of a finger's `bone` moves along `n` for each of the finger's angles, into `row (4,)`."""
    for k in range(CHAIN_LENGTH):
        angle = chains.angles[finger, k]
        row[k] = 0.0
        if angle >= 0 and angle_moves(skeleton.angle_bones, angle, bone):
            origin, axis = positions[skeleton.angle_bones[angle]], axes[angle]
            rx, ry, rz = p[0] - origin[0], p[1] - origin[1], p[2] - origin[2]
            row[k] = n[0] * (axis[1] * rz - axis[2] * ry) + n[1] * (axis[2] * rx - axis[0] * rz)
            row[k] += n[2] * (axis[0] * ry - axis[1] * rx)


@inner
def add_equation(
    row: Array, n: Array, apart: float, weight: float, normal: Array, slope: Array, mixed: Array, wrist, pull
):
    """One equation `row · angles + n · shift = apart` of a finger, added to its normal equations and to the wrist's."""
    for a in range(CHAIN_LENGTH):
        slope[a] += weight * row[a] * apart
        for b in range(a + 1):
            normal[a, b] += weight * row[a] * row[b]
        for i in range(3):
            mixed[a, i] += weight * row[a] * n[i]
    for i in range(3):
        pull[i] += weight * n[i] * apart
        for j in range(3):
            wrist[i, j] += weight * n[i] * n[j]


@inner
def solve_wrist(wrist: Array, pull: Array, out: Array):
    """Solve the symmetric 3 x 3 system by Cramer's rule, into `out (3,)`."""
    a, b, c, d, e, f = wrist[0, 0], wrist[0, 1], wrist[0, 2], wrist[1, 1], wrist[1, 2], wrist[2, 2]
    p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
    size = 1.0 / (a * p + b * q + c * r)
    out[0] = (p * pull[0] + q * pull[1] + r * pull[2]) * size
    out[1] = (q * pull[0] + (a * f - c * c) * pull[1] + (b * c - a * e) * pull[2]) * size
    out[2] = (r * pull[0] + (b * c - a * e) * pull[1] + (a * d - b * b) * pull[2]) * size


@inner
def load_finger(normal: Array, slope: Array, mixed: Array, square: Array, sides: Array):
    """Copy a finger's system, which the solution replaces: the slope, then the three columns of the wrist."""
    for a in range(CHAIN_LENGTH):
        sides[a, 0] = slope[a]
        for j in range(3):
            sides[a, 1 + j] = mixed[a, j]
        for b in range(CHAIN_LENGTH):
            square[a, b] = normal[a, b]
