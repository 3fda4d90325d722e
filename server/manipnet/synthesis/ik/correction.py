"""Inverse kinematics of one hand at one tick: targets, a solver, and corrections that fade in and out.

Each `correct_…` here is the step of a solver in `solvers.SOLVERS`: it writes the `angles (A,)` that meet the contacts
of a `Problem`, and updates the `correction (A,)` that is carried from tick to tick.
"""

from typing import NamedTuple

from manipnet.geometry import Array
from manipnet.jit import inner, matrix, stack_array, vector
from manipnet.synthesis.hand.hand import MAX_ANGLES, MAX_JOINTS, Chains, Skeleton
from manipnet.synthesis.ik.ccd import solve_ccd
from manipnet.synthesis.ik.chains import Surface, clamp
from manipnet.synthesis.ik.grasp import grasp_confidence, slip_and_rest
from manipnet.synthesis.ik.grip import Grip
from manipnet.synthesis.ik.least_squares import solve_least_squares
from manipnet.synthesis.ik.targets import place_targets
from manipnet.synthesis.model.layout import PRESENT
from manipnet.synthesis.objects.shape import Solid
from manipnet.synthesis.sensing.scene import object_from_wrist

_targets, _reference = stack_array(MAX_JOINTS, 3), stack_array(MAX_ANGLES)
FADE_SHARE = 0.6
"""Share of the way to a new correction that one tick goes, so that fingers do not pop."""

CLEAR_M = 0.010
"""How far the fingers keep away from an object that the hand passes."""


class Problem(NamedTuple):
    """One hand beside one object, and the pose that the network predicts for it."""

    skeleton: Skeleton
    chains: Chains
    limits: Array
    """`(A, 2)` radians."""
    solid: Solid
    wrist: Array
    """`(21, 7)` window of the scene as the network sees it."""
    other_wrist: Array
    """`(21, 3)`"""
    object: Array
    """`(21, 7)`"""
    mirrored: bool
    scale: float
    predicted: Array
    """`(A,)` angles."""
    positions: Array
    """`(J, 3)` joints of the predicted pose."""
    distances: Array
    """`(J,)` from the joints to the surface as predicted, metres."""
    grip: Grip
    """What the hand remembers of its grip."""


@inner
def _place_surface(problem: Problem, rotation: Array, translation: Array, targets: Array):
    """The object as the wrist sees it at the present, and `targets (J, 3)` of the joints."""
    wrist, obj = problem.wrist[PRESENT], problem.object[PRESENT]
    object_from_wrist(wrist, obj, problem.mirrored, rotation, translation)
    place_targets(problem.solid, rotation, translation, problem.scale, problem.positions, problem.distances, targets)
    return Surface(problem.solid.field, rotation, translation, problem.scale)


@inner
def _fade(problem: Problem, angles: Array, correction: Array):
    for angle in range(len(angles)):
        correction[angle] += FADE_SHARE * (angles[angle] - problem.predicted[angle] - correction[angle])
        angles[angle] = clamp(problem.predicted[angle] + correction[angle], problem.limits, angle)


@inner
def correct_by_least_squares(problem: Problem, angles: Array, correction: Array):
    """Damped least squares, which starts from the last tick's correction."""
    rotation, translation, targets = matrix(), vector(), _targets()
    surface = _place_surface(problem, rotation, translation, targets)
    confidence = grasp_confidence(problem.wrist, problem.object, problem.other_wrist)
    for angle in range(len(angles)):
        angles[angle] = clamp(problem.predicted[angle] + correction[angle], problem.limits, angle)
    solve_least_squares(
        problem.skeleton,
        problem.chains,
        problem.predicted,
        targets,
        problem.distances,
        confidence,
        0.0,
        problem.limits,
        surface,
        problem.grip.weights,
        problem.grip.anchors,
        angles,
    )
    _fade(problem, angles, correction)


@inner
def correct_by_wrench(problem: Problem, angles: Array, correction: Array):
    """Damped least squares in which fingers that carry the object have poses of their own, and those of a hand that
    passes it keep clear of it."""
    rotation, translation, targets, reference = matrix(), vector(), _targets(), _reference()
    surface = _place_surface(problem, rotation, translation, targets)
    slips, rests = slip_and_rest(problem.wrist, problem.object)
    confidence = grasp_confidence(problem.wrist, problem.object, problem.other_wrist)
    clear_m = CLEAR_M * slips * max(rests, 1.0 - confidence)
    grip = problem.grip
    for angle in range(len(angles)):
        reference[angle] = clamp(problem.predicted[angle] + grip.offsets[angle], problem.limits, angle)
    for angle in range(len(angles)):
        angles[angle] = clamp(problem.predicted[angle] + correction[angle], problem.limits, angle)
    solve_least_squares(
        problem.skeleton,
        problem.chains,
        reference,
        targets,
        problem.distances,
        confidence,
        clear_m,
        problem.limits,
        surface,
        grip.weights,
        grip.anchors,
        angles,
    )
    _fade(problem, angles, correction)


@inner
def correct_by_ccd(problem: Problem, angles: Array, correction: Array):
    """The paper's solver."""
    rotation, translation, targets = matrix(), vector(), _targets()
    _place_surface(problem, rotation, translation, targets)
    solve_ccd(problem.skeleton, problem.chains, problem.predicted, targets, problem.limits, angles)
    _fade(problem, angles, correction)


@inner
def correct_nothing(problem: Problem, angles: Array, correction: Array):
    """No inverse kinematics."""
    for angle in range(len(angles)):
        angles[angle] = problem.predicted[angle]
