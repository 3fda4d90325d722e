"""Inverse kinematics of one hand at one tick: targets, a solver, and corrections that fade in and out.

Each solver is a kernel of its own, so that only the one in use is compiled.
"""

from typing import Literal

import numpy as np

from manipnet.ik.ccd import solve_ccd
from manipnet.ik.chains import clamp
from manipnet.ik.grip import hold_share
from manipnet.ik.least_squares import solve_least_squares
from manipnet.ik.targets import place_targets
from manipnet.kernels import njit
from manipnet.network.layout import PRESENT
from manipnet.sensing.scene import object_from_wrist

SolverName = Literal["least_squares", "ccd", "none"]
SOLVERS: tuple[SolverName, ...] = ("least_squares", "ccd", "none")

FADE_SHARE = 0.5
"""How much of the way to a new correction one tick goes: no popping."""


@njit(cache=True, nogil=True)
def _fade(angles, predicted, correction, limits):
    for dof in range(len(angles)):
        correction[dof] += FADE_SHARE * (angles[dof] - predicted[dof] - correction[dof])
        angles[dof] = clamp(predicted[dof] + correction[dof], limits, dof)


@njit(cache=True, nogil=True)
def correct_by_least_squares(
    bvh, field, exact_within_m, wrist, obj, mirrored, scale, positions, distances, limits, angles, correction
):
    """Move `angles (20,)` toward the contacts that joint `positions (22, 3)` and predicted `distances (22,)` call for.

    `wrist` and `obj` are windows `(21, 7)` of the scene the network sees; `correction (20,)` is carried from
    tick to tick.
    """
    rotation, translation, targets = np.empty((3, 3)), np.empty(3), np.empty((22, 3))
    predicted = angles.copy()
    object_from_wrist(wrist[PRESENT], obj[PRESENT], mirrored, rotation, translation)
    place_targets(bvh, field, rotation, translation, scale, exact_within_m, positions, distances, targets)
    hold = hold_share(wrist, obj)
    solve_least_squares(angles, targets, distances, hold, limits, field, rotation, translation, scale)
    _fade(angles, predicted, correction, limits)


@njit(cache=True, nogil=True)
def correct_by_ccd(
    bvh, field, exact_within_m, wrist, obj, mirrored, scale, positions, distances, limits, angles, correction
):
    """The same with the paper's solver."""
    rotation, translation, targets = np.empty((3, 3)), np.empty(3), np.empty((22, 3))
    predicted = angles.copy()
    object_from_wrist(wrist[PRESENT], obj[PRESENT], mirrored, rotation, translation)
    place_targets(bvh, field, rotation, translation, scale, exact_within_m, positions, distances, targets)
    solve_ccd(angles, targets, limits)
    _fade(angles, predicted, correction, limits)


CORRECTIONS = {"least_squares": correct_by_least_squares, "ccd": correct_by_ccd}
"""The kernel of each solver but `none`."""
