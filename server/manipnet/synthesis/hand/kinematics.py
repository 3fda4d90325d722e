"""Forward kinematics of a hand's angles, and the angles nearest to given bone rotations.

All results are in the wrist frame of a right hand (see `hand`). Kernels ending in `_into` take the `Skeleton` of one
hand and write into arrays of the caller; the tick and the solvers call them. Functions that take a `Hand` accept any
leading shape.
"""

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, kernel, matrix, stack_array
from manipnet.synthesis.hand.hand import CHAIN_LENGTH, MAX_ANGLES, Chains, Hand, Skeleton
from manipnet.synthesis.hand.packed import unpack_skeleton
from manipnet.synthesis.rotations import (
    axis_rotation_into,
    copy_matrix_into,
    multiply_matrices_into,
    set_identity,
)

_axes = stack_array(MAX_ANGLES, 3)


@inner
def _apply_offset_into(parent_position: Array, parent_rotation: Array, offset: Array, out: Array):
    for i in range(3):
        out[i] = parent_position[i] + (
            parent_rotation[i, 0] * offset[0] + parent_rotation[i, 1] * offset[1] + parent_rotation[i, 2] * offset[2]
        )


@inner
def pose_bone_into(skeleton: Skeleton, bone, angles: Array, positions: Array, rotations: Array, axes: Array):
    """Place one bone after its parent: row `bone` of `positions (J, 3)` and `rotations (B, 3, 3)`, and its `axes`."""
    hinges, hinge, turned = skeleton.axes, matrix(), matrix()
    parent = skeleton.parents[bone]
    _apply_offset_into(positions[parent], rotations[parent], skeleton.offsets[bone], positions[bone])
    frame = rotations[bone]
    copy_matrix_into(rotations[parent], frame)
    first = skeleton.first_angle[bone]
    for angle in range(first, first + skeleton.angle_counts[bone]):
        for i in range(3):
            axes[angle, i] = (
                frame[i, 0] * hinges[angle, 0] + frame[i, 1] * hinges[angle, 1] + frame[i, 2] * hinges[angle, 2]
            )
        axis_rotation_into(hinges[angle], angles[angle], hinge)
        multiply_matrices_into(frame, hinge, turned)
        copy_matrix_into(turned, frame)
    multiply_matrices_into(frame, skeleton.rest[bone], turned)
    copy_matrix_into(turned, frame)


@inner
def pose_tip_into(skeleton: Skeleton, tip, positions: Array, rotations: Array):
    """Place one fingertip after its bone."""
    parent = skeleton.parents[tip]
    _apply_offset_into(positions[parent], rotations[parent], skeleton.offsets[tip], positions[tip])


@inner
def forward_kinematics_into(skeleton: Skeleton, angles: Array, positions: Array, rotations: Array, axes: Array):
    """Pose one hand: `angles (A,)` into `positions (J, 3)`, `rotations (B, 3, 3)` and hinge `axes (A, 3)`."""
    bones = len(skeleton.rest)
    positions[0] = 0.0
    set_identity(rotations[0])
    for bone in range(1, bones):
        pose_bone_into(skeleton, bone, angles, positions, rotations, axes)
    for tip in range(bones, len(skeleton.parents)):
        pose_tip_into(skeleton, tip, positions, rotations)


@inner
def pose_finger_into(
    skeleton: Skeleton, chains: Chains, finger: int, angles: Array, positions: Array, rotations: Array, axes: Array
):
    """Pose one finger of a hand that `forward_kinematics_into` has posed before; the other fingers stay as they are."""
    bones = len(skeleton.rest)
    pose_bone_into(skeleton, skeleton.parents[chains.joints[finger, 0]], angles, positions, rotations, axes)
    for k in range(CHAIN_LENGTH):
        joint = chains.joints[finger, k]
        if joint < 0:
            continue
        if joint < bones:
            pose_bone_into(skeleton, joint, angles, positions, rotations, axes)
        else:
            pose_tip_into(skeleton, joint, positions, rotations)


@inner
def _hinge_angle(m: Array, axis: Array):
    """Angle about `axis` of the rotation nearest to the matrix `m`: the maximiser of trace(R(angle)ᵀ m)."""
    x, y, z = axis[0], axis[1], axis[2]
    sine = x * (m[2, 1] - m[1, 2]) + y * (m[0, 2] - m[2, 0]) + z * (m[1, 0] - m[0, 1])
    along = 0.0
    for i in range(3):
        for j in range(3):
            along += axis[i] * m[i, j] * axis[j]
    return np.arctan2(sine, m[0, 0] + m[1, 1] + m[2, 2] - along)


@inner
def _turn_about(u: Array, v: Array, m: Array):
    """Angle about the unit axis `u` that turns `v` into the direction of `m v`, seen along the axis."""
    x = m[0, 0] * v[0] + m[0, 1] * v[1] + m[0, 2] * v[2]
    y = m[1, 0] * v[0] + m[1, 1] * v[1] + m[1, 2] * v[2]
    z = m[2, 0] * v[0] + m[2, 1] * v[1] + m[2, 2] * v[2]
    sine = u[0] * (v[1] * z - v[2] * y) + u[1] * (v[2] * x - v[0] * z) + u[2] * (v[0] * y - v[1] * x)
    along = (u[0] * v[0] + u[1] * v[1] + u[2] * v[2]) * (u[0] * x + u[1] * y + u[2] * z)
    return np.arctan2(sine, v[0] * x + v[1] * y + v[2] * z - along)


@inner
def angles_from_rotations_into(skeleton: Skeleton, rotations: Array, angles: Array):
    """The angles whose hand is nearest to bone `rotations (B, 3, 3)`, joint by joint, into `angles (A,)`."""
    local, work, back = matrix(), matrix(), matrix()
    for bone in range(1, len(skeleton.rest)):
        parent = rotations[skeleton.parents[bone]]
        for i in range(3):
            for j in range(3):
                work[i, j] = 0.0
                for k in range(3):
                    work[i, j] += parent[k, i] * rotations[bone, k, j]
        for i in range(3):
            for j in range(3):
                local[i, j] = 0.0
                for k in range(3):
                    local[i, j] += work[i, k] * skeleton.rest[bone, j, k]
        first, count = skeleton.first_angle[bone], skeleton.angle_counts[bone]
        if count == 2:
            u, v = skeleton.axes[first], skeleton.axes[first + 1]
            # local = R(u, flexion) R(v, abduction) leaves v where the flexion alone puts it
            angles[first] = _turn_about(u, v, local)
            axis_rotation_into(u, -angles[first], back)
            multiply_matrices_into(back, local, work)
            angles[first + 1] = _hinge_angle(work, v)
        elif count == 1:
            angles[first] = _hinge_angle(local, skeleton.axes[first])


@kernel
def _forward_batch(hand: np.ndarray, angles: Array, positions: Array, rotations: Array):
    skeleton, axes = unpack_skeleton(hand), _axes()
    for i in range(len(angles)):
        forward_kinematics_into(skeleton, angles[i], positions[i], rotations[i], axes)


@kernel
def _angles_batch(hand: np.ndarray, rotations: Array, angles: Array):
    skeleton = unpack_skeleton(hand)
    for i in range(len(rotations)):
        angles_from_rotations_into(skeleton, rotations[i], angles[i])


def forward_kinematics(hand: Hand, angles: Array) -> tuple[Array, Array]:
    """Angles `(..., A)` in radians to joint positions `(..., J, 3)` in metres and rotations `(..., B, 3, 3)`."""
    flat = np.ascontiguousarray(angles, dtype=np.float64).reshape(-1, hand.angle_count)
    positions = np.empty((len(flat), hand.joint_count, 3))
    rotations = np.empty((len(flat), hand.bone_count, 3, 3))
    _forward_batch(hand.packed, flat, positions, rotations)
    lead = np.shape(angles)[:-1]
    return positions.reshape(*lead, *positions.shape[1:]), rotations.reshape(*lead, *rotations.shape[1:])


def angles_from_rotations(hand: Hand, rotations: Array) -> Array:
    """Bone rotations `(..., B, 3, 3)` in the wrist frame to the nearest angles `(..., A)`; limits are not applied."""
    flat = np.ascontiguousarray(rotations, dtype=np.float64).reshape(-1, hand.bone_count, 3, 3)
    angles = np.empty((len(flat), hand.angle_count))
    _angles_batch(hand.packed, flat, angles)
    return angles.reshape(*np.shape(rotations)[:-3], hand.angle_count)
