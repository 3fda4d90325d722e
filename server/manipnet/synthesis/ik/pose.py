"""From the network's outputs to posed hands: angles, contacts corrected by a solver, joints.

Each solver has a kernel of its own, so that only the one in use is compiled.
"""

from typing import Literal, NamedTuple

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, kernel, stack_array
from manipnet.synthesis.hand.kinematics import forward_kinematics_into
from manipnet.synthesis.hand.skeleton import BONE_COUNT, DOF_COUNT, JOINT_COUNT
from manipnet.synthesis.ik.correction import correct_by_ccd, correct_by_least_squares
from manipnet.synthesis.model.decode import decode_into

SolverName = Literal["least_squares", "ccd", "none"]
SOLVERS: tuple[SolverName, ...] = ("least_squares", "ccd", "none")
FEEDBACK_SHARE = 0.5
"""How much of its corrections the network sees of its own hand: with all of them it strays from the poses it has
learned, with none it does not know what it holds (docs/results.md, Ideas tried)."""


class Poses(NamedTuple):
    """`N` hands at one tick, each in its own wrist frame as a right hand."""

    angles: Array
    """`(N, 20)` radians."""
    positions: Array
    """`(N, 22, 3)` metres."""
    rotations: Array
    """`(N, 17, 3, 3)`."""
    correction: Array
    """`(N, 20)` what inverse kinematics added to the network's angles, radians; before a tick, that of the last."""
    distances: Array
    """`(N, 22)` joint to surface as predicted, metres, in [0, 0.035]."""
    raw_positions: Array
    """`(N, 22, 3)` before inverse kinematics."""
    feedback_angles: Array
    """`(N, 20)` the hand as the network is to see it at the next tick, with `FEEDBACK_SHARE` of the correction."""
    feedback_positions: Array
    feedback_rotations: Array


def allocate_poses(count: int) -> Poses:
    """Poses of `count` hands, still to be filled in."""
    return Poses(
        np.empty((count, DOF_COUNT)),
        np.empty((count, JOINT_COUNT, 3)),
        np.empty((count, BONE_COUNT, 3, 3)),
        np.empty((count, DOF_COUNT)),
        np.empty((count, JOINT_COUNT)),
        np.empty((count, JOINT_COUNT, 3)),
        np.empty((count, DOF_COUNT)),
        np.empty((count, JOINT_COUNT, 3)),
        np.empty((count, BONE_COUNT, 3, 3)),
    )


_axes, _angles = stack_array(DOF_COUNT, 3), stack_array(DOF_COUNT)


@inner
def _predict(output, before, response, limits, axes, n, poses, predicted):
    """What the network alone says of hand `n`: its angles into `predicted (20,)`, raw positions and distances."""
    decode_into(output, before, response, limits, poses.rotations[n], predicted, poses.distances[n])
    forward_kinematics_into(predicted, poses.raw_positions[n], poses.rotations[n], axes)


@inner
def _settle(predicted, axes, n, poses):
    """Joints of hand `n` from its corrected angles, and the hand as the network is to see it."""
    angles, feedback = poses.angles[n], poses.feedback_angles[n]
    forward_kinematics_into(angles, poses.positions[n], poses.rotations[n], axes)
    for dof in range(DOF_COUNT):
        feedback[dof] = predicted[dof] + FEEDBACK_SHARE * (angles[dof] - predicted[dof])
    forward_kinematics_into(feedback, poses.feedback_positions[n], poses.feedback_rotations[n], axes)


@kernel
def pose_by_least_squares(solid, windows, outputs, before, response, limits, first, last, poses):
    """Pose hands `first … last - 1`, all about `solid`, as the network's `outputs (N, 220)` and the angles
    `before (N, 20)` of the last tick say."""
    axes, predicted = _axes(), _angles()
    for n in range(first, last):
        angles = poses.angles[n]
        _predict(outputs[n], before[n], response, limits, axes, n, poses, predicted)
        correct_by_least_squares(
            solid,
            windows.wrist[n],
            windows.other_wrist[n],
            windows.object[n],
            windows.mirrored[n],
            windows.scale[n],
            poses.raw_positions[n],
            poses.distances[n],
            limits,
            predicted,
            angles,
            poses.correction[n],
        )
        _settle(predicted, axes, n, poses)


@kernel
def pose_by_ccd(solid, windows, outputs, before, response, limits, first, last, poses):
    """The same with the paper's solver."""
    axes, predicted = _axes(), _angles()
    for n in range(first, last):
        angles = poses.angles[n]
        _predict(outputs[n], before[n], response, limits, axes, n, poses, predicted)
        correct_by_ccd(
            solid,
            windows.wrist[n],
            windows.object[n],
            windows.mirrored[n],
            windows.scale[n],
            poses.raw_positions[n],
            poses.distances[n],
            limits,
            predicted,
            angles,
            poses.correction[n],
        )
        _settle(predicted, axes, n, poses)


@kernel
def pose_as_predicted(solid, windows, outputs, before, response, limits, first, last, poses):
    """The same without inverse kinematics."""
    axes = _axes()
    for n in range(first, last):
        _predict(outputs[n], before[n], response, limits, axes, n, poses, poses.angles[n])
        _settle(poses.angles[n], axes, n, poses)


POSERS = {"least_squares": pose_by_least_squares, "ccd": pose_by_ccd, "none": pose_as_predicted}
"""The kernel of each solver."""
