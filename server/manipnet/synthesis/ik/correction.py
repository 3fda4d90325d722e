"""Inverse kinematics of one hand at one tick: targets, a solver, and corrections that fade in and out."""

from manipnet.jit import inner, matrix, stack_array, vector
from manipnet.synthesis.ik.ccd import solve_ccd
from manipnet.synthesis.ik.chains import clamp
from manipnet.synthesis.ik.grasp import grasp_confidence
from manipnet.synthesis.ik.least_squares import solve_least_squares
from manipnet.synthesis.ik.targets import place_targets
from manipnet.synthesis.model.layout import PRESENT
from manipnet.synthesis.sensing.scene import object_from_wrist

_targets = stack_array(22, 3)
FADE_SHARE = 0.6
"""How much of the way to a new correction one tick goes: no popping."""


@inner
def _fade(angles, predicted, correction, limits):
    for dof in range(len(angles)):
        correction[dof] += FADE_SHARE * (angles[dof] - predicted[dof] - correction[dof])
        angles[dof] = clamp(predicted[dof] + correction[dof], limits, dof)


@inner
def correct_by_least_squares(
    solid, wrist, other, obj, mirrored, scale, positions, distances, limits, predicted, angles, correction
):
    """From `predicted (20,)` angles to `angles (20,)` nearer to the contacts that the joint `positions (22, 3)` and
    `distances (22,)` they were predicted with call for.

    `wrist`, `other (21, 3)` and `obj` are windows `(21, 7)` of the scene the network sees; `correction (20,)` is
    carried from tick to tick, and the solver starts from it.
    """
    rotation, translation, targets = matrix(), vector(), _targets()
    object_from_wrist(wrist[PRESENT], obj[PRESENT], mirrored, rotation, translation)
    place_targets(solid, rotation, translation, scale, positions, distances, targets)
    hold = grasp_confidence(wrist, obj, other)
    for dof in range(len(angles)):
        angles[dof] = clamp(predicted[dof] + correction[dof], limits, dof)
    solve_least_squares(predicted, targets, distances, hold, limits, solid.field, rotation, translation, scale, angles)
    _fade(angles, predicted, correction, limits)


@inner
def correct_by_ccd(solid, wrist, obj, mirrored, scale, positions, distances, limits, predicted, angles, correction):
    """The same with the paper's solver."""
    rotation, translation, targets = matrix(), vector(), _targets()
    object_from_wrist(wrist[PRESENT], obj[PRESENT], mirrored, rotation, translation)
    place_targets(solid, rotation, translation, scale, positions, distances, targets)
    solve_ccd(predicted, targets, limits, angles)
    _fade(angles, predicted, correction, limits)
