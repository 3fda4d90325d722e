"""From the network's outputs to posed hands: angles, contacts corrected by a solver, joints.

Each solver has a kernel of its own, so that only the one in use is compiled.
"""

from collections.abc import Callable
from functools import cache
from importlib import import_module
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, kernel, stack_array
from manipnet.synthesis.hand.hand import MAX_ANGLES, Hand, Indices, Skeleton
from manipnet.synthesis.hand.kinematics import forward_kinematics_into
from manipnet.synthesis.hand.packed import unpack_chains, unpack_skeleton
from manipnet.synthesis.ik.correction import Problem, correct_nothing
from manipnet.synthesis.ik.grip import grip_size, unpack_grip
from manipnet.synthesis.ik.holders import Hands
from manipnet.synthesis.ik.holding import leave_grips
from manipnet.synthesis.ik.solvers import solver_named
from manipnet.synthesis.model.decode import decode_into, unpack_output_columns
from manipnet.synthesis.model.features import Windows
from manipnet.synthesis.model.layout import OutputColumns
from manipnet.synthesis.objects.shape import Solid

FEEDBACK_SHARE = 0.5
"""Share of its corrections that the network sees of its own hand: with all of them it strays from the poses it has
learned, with none it does not know what it holds (docs/tried.md)."""

_axes, _angles = stack_array(MAX_ANGLES, 3), stack_array(MAX_ANGLES)
_correct: Callable[..., Any] = correct_nothing
_improve: Callable[..., Any] = leave_grips


class Poses(NamedTuple):
    """`N` hands at one tick, each in its own wrist frame as a right hand."""

    angles: Array
    """`(N, A)` radians."""
    positions: Array
    """`(N, J, 3)` metres."""
    rotations: Array
    """`(N, B, 3, 3)`."""
    correction: Array
    """`(N, A)` what inverse kinematics added to the network's angles, radians; before a tick, the last tick's."""
    distances: Array
    """`(N, J)` joint to surface as predicted, metres, in [0, 0.035]."""
    raw_positions: Array
    """`(N, J, 3)` before inverse kinematics."""
    feedback_angles: Array
    """`(N, A)` the hand as the network is to see it at the next tick, with `FEEDBACK_SHARE` of the correction."""
    feedback_positions: Array
    feedback_rotations: Array
    grip: Array
    """`(N, G)` what the hands remember of their grips; before a tick, as the last tick left it."""
    predicted: Array
    """`(N, A)` the network's own angles."""


def allocate_poses(hand: Hand, count: int) -> Poses:
    """Memory for the poses of `count` hands."""
    angles, joints, bones = hand.angle_count, hand.joint_count, hand.bone_count
    return Poses(
        np.empty((count, angles)),
        np.empty((count, joints, 3)),
        np.empty((count, bones, 3, 3)),
        np.empty((count, angles)),
        np.empty((count, joints)),
        np.empty((count, joints, 3)),
        np.empty((count, angles)),
        np.empty((count, joints, 3)),
        np.empty((count, bones, 3, 3)),
        np.zeros((count, grip_size(len(hand.fingers), angles))),
        np.empty((count, angles)),
    )


@inner
def _predict(
    skeleton: Skeleton,
    columns: OutputColumns,
    output: Array,
    before: Array,
    response: float,
    limits: Array,
    axes: Array,
    n: int,
    poses: Poses,
    predicted: Array,
):
    """The network's own pose of hand `n`: its angles into `predicted (A,)`, raw positions and distances."""
    decode_into(skeleton, columns, output, before, response, limits, poses.rotations[n], predicted, poses.distances[n])
    forward_kinematics_into(skeleton, predicted, poses.raw_positions[n], poses.rotations[n], axes)


@inner
def _settle(skeleton: Skeleton, predicted: Array, axes: Array, n: int, poses: Poses):
    """Joints of hand `n` from its corrected angles, and the hand as the network is to see it."""
    angles, feedback = poses.angles[n], poses.feedback_angles[n]
    forward_kinematics_into(skeleton, angles, poses.positions[n], poses.rotations[n], axes)
    for angle in range(len(angles)):
        feedback[angle] = predicted[angle] + FEEDBACK_SHARE * (angles[angle] - predicted[angle])
    forward_kinematics_into(skeleton, feedback, poses.feedback_positions[n], poses.feedback_rotations[n], axes)


def _pose(
    hand: np.ndarray,
    starts: Indices,
    solid: Solid,
    windows: Windows,
    outputs: np.ndarray,
    before: Array,
    response: float,
    limits: Array,
    first: int,
    last: int,
    poses: Poses,
):
    """Pose hands `first … last - 1`, all about `solid`, from the network's `outputs (N, output_size)` and the angles
    `before (N, A)` of the last tick."""
    skeleton, chains, columns = unpack_skeleton(hand), unpack_chains(hand), unpack_output_columns(starts)
    axes = _axes()
    for n in range(first, last):
        predicted = poses.predicted[n]
        _predict(skeleton, columns, outputs[n], before[n], response, limits, axes, n, poses, predicted)
        problem = Problem(
            skeleton,
            chains,
            limits,
            solid,
            windows.wrist[n],
            windows.other_wrist[n],
            windows.object[n],
            windows.mirrored[n],
            windows.scale[n],
            predicted,
            poses.raw_positions[n],
            poses.distances[n],
            unpack_grip(poses.grip[n], len(chains.angles)),
        )
        _correct(problem, poses.angles[n], poses.correction[n])
        _settle(skeleton, predicted, axes, n, poses)
    posed = poses.predicted, poses.angles, poses.distances, poses.grip
    _improve(Hands(skeleton, chains, limits, solid, windows, first, last, *posed))


def make_pose_kernel(correct: Callable[..., Any], improve: Callable[..., Any], name: str) -> Callable[..., None]:
    """`_pose` compiled with the step `correct`, under a name of its own in the cache on disk.

    The step is a global of the compiled function, because Numba cannot find a closure over a compiled function again:
    it files one by a number that is new in every process.
    """
    function = FunctionType(_pose.__code__, {**globals(), "_correct": correct, "_improve": improve}, name)
    function.__qualname__, function.__module__ = name, __name__
    return kernel(function)


@cache
def pose_kernel(solver: str) -> Callable[..., None]:
    """The kernel of a solver in `solvers.SOLVERS`, compiled when it is first called. Raises `UnknownSolverError`."""
    solver_ = solver_named(solver)
    return make_pose_kernel(_function(solver_.correct), _function(solver_.improve), f"pose_by_{solver}")


def _function(place: str) -> Callable[..., Any]:
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)
