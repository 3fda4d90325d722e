"""Forward kinematics of the 20 angles, and the angles nearest to given bone rotations.

All results are in the wrist frame of a right hand (see `skeleton`). The kernels ending in `_into` take one hand, write
into arrays of the caller and are what the live tick and the solver call; the functions without take any leading shape.
"""

import numpy as np

from manipnet.geometry import Array, quat_to_matrix
from manipnet.jit import inner, kernel, matrix, stack_array
from manipnet.synthesis.hand.skeleton import (
    BONE_COUNT,
    DOF_AXES,
    DOF_COUNT,
    DOF_JOINTS,
    JOINT_COUNT,
    OFFSETS_M,
    PARENTS,
    REST_QUATS,
)

_axes = stack_array(DOF_COUNT, 3)
_REST = quat_to_matrix(REST_QUATS)
_FIRST_DOF = np.array([int(np.argmax(j == DOF_JOINTS)) if j in DOF_JOINTS else -1 for j in range(BONE_COUNT)])
_DOFS_OF_BONE = np.array([int(np.sum(j == DOF_JOINTS)) for j in range(BONE_COUNT)])


@inner
def axis_rotation_into(axis, angle, out):
    """Rodrigues' formula: the matrix turning by `angle` about the unit `axis`, into `out` `(3, 3)`."""
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = axis[0], axis[1], axis[2]
    k = 1.0 - c
    out[0, 0], out[0, 1], out[0, 2] = c + x * x * k, x * y * k - z * s, x * z * k + y * s
    out[1, 0], out[1, 1], out[1, 2] = y * x * k + z * s, c + y * y * k, y * z * k - x * s
    out[2, 0], out[2, 1], out[2, 2] = z * x * k - y * s, z * y * k + x * s, c + z * z * k


@inner
def _copy_into(a, out):
    # a slice assignment would compile numpy's broadcasting, with its error texts, for seconds
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, j]


@inner
def set_identity(out):
    """The identity into `out (3, 3)`."""
    for i in range(3):
        for j in range(3):
            out[i, j] = 1.0 if i == j else 0.0


@inner
def _multiply_into(a, b, out):
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@inner
def _apply_offset_into(parent_position, parent_rotation, offset, out):
    for i in range(3):
        out[i] = parent_position[i] + (
            parent_rotation[i, 0] * offset[0] + parent_rotation[i, 1] * offset[1] + parent_rotation[i, 2] * offset[2]
        )


@inner
def forward_kinematics_into(angles, positions, rotations, axes):
    """Pose of one hand: `angles (20,)` into `positions (22, 3)`, `rotations (17, 3, 3)`, hinge `axes (20, 3)`."""
    hinge, turned = matrix(), matrix()
    positions[0] = 0.0
    set_identity(rotations[0])
    for bone in range(1, BONE_COUNT):
        parent = PARENTS[bone]
        _apply_offset_into(positions[parent], rotations[parent], OFFSETS_M[bone], positions[bone])
        frame = rotations[bone]
        _copy_into(rotations[parent], frame)
        for dof in range(_FIRST_DOF[bone], _FIRST_DOF[bone] + _DOFS_OF_BONE[bone]):
            for i in range(3):
                axes[dof, i] = (
                    frame[i, 0] * DOF_AXES[dof, 0] + frame[i, 1] * DOF_AXES[dof, 1] + frame[i, 2] * DOF_AXES[dof, 2]
                )
            axis_rotation_into(DOF_AXES[dof], angles[dof], hinge)
            _multiply_into(frame, hinge, turned)
            _copy_into(turned, frame)
        _multiply_into(frame, _REST[bone], turned)
        _copy_into(turned, frame)
    for tip in range(BONE_COUNT, JOINT_COUNT):
        parent = PARENTS[tip]
        _apply_offset_into(positions[parent], rotations[parent], OFFSETS_M[tip], positions[tip])


@inner
def _hinge_angle(m, axis):
    """Angle about `axis` of the rotation nearest to the matrix `m`: the maximiser of trace(R(angle)ᵀ m)."""
    x, y, z = axis[0], axis[1], axis[2]
    sine = x * (m[2, 1] - m[1, 2]) + y * (m[0, 2] - m[2, 0]) + z * (m[1, 0] - m[0, 1])
    along = 0.0
    for i in range(3):
        for j in range(3):
            along += axis[i] * m[i, j] * axis[j]
    return np.arctan2(sine, m[0, 0] + m[1, 1] + m[2, 2] - along)


@inner
def _turn_about(u, v, m):
    """Angle about the unit axis `u` that turns `v` into the direction of `m v`, seen along the axis."""
    x = m[0, 0] * v[0] + m[0, 1] * v[1] + m[0, 2] * v[2]
    y = m[1, 0] * v[0] + m[1, 1] * v[1] + m[1, 2] * v[2]
    z = m[2, 0] * v[0] + m[2, 1] * v[1] + m[2, 2] * v[2]
    sine = u[0] * (v[1] * z - v[2] * y) + u[1] * (v[2] * x - v[0] * z) + u[2] * (v[0] * y - v[1] * x)
    along = (u[0] * v[0] + u[1] * v[1] + u[2] * v[2]) * (u[0] * x + u[1] * y + u[2] * z)
    return np.arctan2(sine, v[0] * x + v[1] * y + v[2] * z - along)


@inner
def angles_from_rotations_into(rotations, angles):
    """The 20 angles whose hand is nearest to bone `rotations (17, 3, 3)`, joint by joint, into `angles (20,)`."""
    local, work, back = matrix(), matrix(), matrix()
    for bone in range(1, BONE_COUNT):
        parent = rotations[PARENTS[bone]]
        for i in range(3):
            for j in range(3):
                work[i, j] = 0.0
                for k in range(3):
                    work[i, j] += parent[k, i] * rotations[bone, k, j]
        for i in range(3):
            for j in range(3):
                local[i, j] = 0.0
                for k in range(3):
                    local[i, j] += work[i, k] * _REST[bone, j, k]
        first = _FIRST_DOF[bone]
        if _DOFS_OF_BONE[bone] == 2:
            u, v = DOF_AXES[first], DOF_AXES[first + 1]
            # local = R(u, flexion) R(v, abduction) leaves v where the flexion alone puts it
            angles[first] = _turn_about(u, v, local)
            axis_rotation_into(u, -angles[first], back)
            _multiply_into(back, local, work)
            angles[first + 1] = _hinge_angle(work, v)
        else:
            angles[first] = _hinge_angle(local, DOF_AXES[first])


@kernel
def _forward_batch(angles, positions, rotations):
    axes = _axes()
    for i in range(len(angles)):
        forward_kinematics_into(angles[i], positions[i], rotations[i], axes)


@kernel
def _angles_batch(rotations, angles):
    for i in range(len(rotations)):
        angles_from_rotations_into(rotations[i], angles[i])


def forward_kinematics(angles: Array) -> tuple[Array, Array]:
    """Angles `(..., 20)` in radians to joint positions `(..., 22, 3)` in metres and rotations `(..., 17, 3, 3)`."""
    flat = np.ascontiguousarray(angles, dtype=np.float64).reshape(-1, DOF_COUNT)
    positions, rotations = np.empty((len(flat), JOINT_COUNT, 3)), np.empty((len(flat), BONE_COUNT, 3, 3))
    _forward_batch(flat, positions, rotations)
    lead = np.shape(angles)[:-1]
    return positions.reshape(*lead, JOINT_COUNT, 3), rotations.reshape(*lead, BONE_COUNT, 3, 3)


def angles_from_rotations(rotations: Array) -> Array:
    """Bone rotations `(..., 17, 3, 3)` in the wrist frame to the nearest angles `(..., 20)`; limits are not applied."""
    flat = np.ascontiguousarray(rotations, dtype=np.float64).reshape(-1, BONE_COUNT, 3, 3)
    angles = np.empty((len(flat), DOF_COUNT))
    _angles_batch(flat, angles)
    return angles.reshape(*np.shape(rotations)[:-3], DOF_COUNT)
