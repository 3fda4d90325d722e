"""Damped least squares over the 20 angles: joints to targets, capsules out of the object, near the network's pose.

Each finger is a problem of four unknowns; a few Gauss-Newton steps with a 4 x 4 Cholesky solve are exact enough and
cost microseconds. Capsules meet the field, not the triangles: it is smooth and has its own gradient.
"""

import numpy as np

from manipnet.jit import inner, stack_array
from manipnet.synthesis.hand.kinematics import forward_kinematics_into
from manipnet.synthesis.hand.skeleton import BONE_COUNT, DOF_COUNT, DOF_JOINTS, PARENTS
from manipnet.synthesis.ik.chains import (
    CAPSULE_ENDS,
    CAPSULE_RADII,
    CAPSULE_STARTS,
    CAPSULES,
    DOFS,
    FINGERS,
    MOVED_JOINTS,
    clamp,
    dof_moves,
)
from manipnet.synthesis.ik.depenetration import push_out_deep_fingers
from manipnet.synthesis.ik.grasp import grip_into
from manipnet.synthesis.objects.distance_field import field_distance
from manipnet.synthesis.sensing.scene import map_direction_back, map_point

ITERATIONS = 4
SAMPLES = 4
"""Points along a capsule's axis that are kept a radius away from the surface."""
TARGET_WEIGHT = 1.0
SURFACE_WEIGHT = 6.0
STAY_WEIGHT_M2 = 4e-5
"""Pull toward the network's angles, in square metres per square radian."""
ALLOWED_DEPTH_M = 0.002
"""Skin gives: the captured fingers are about this deep where they press."""
PULL_WEIGHT = 3.0
PULL_REACH_M = 0.012
"""Capsules this near the surface that the network says are in contact are pulled onto it."""
CONTACT_MARGIN_M = 0.006
"""A predicted distance of a capsule's radius means contact; this much more means none."""
GRIP_SHARE = 0.4
"""Pull on the fingers of a hand that holds, over that on capsules the network says touch."""
GRIP_REACH_M = 0.030
"""How far away the surface may be that they are pulled onto."""
_MAX_STEP_RAD = 0.2
_positions, _rotations, _axes = stack_array(22, 3), stack_array(BONE_COUNT, 3, 3), stack_array(DOF_COUNT, 3)
_square, _columns, _numbers, _grip = (
    stack_array(DOFS, DOFS),
    stack_array(DOFS, 3),
    stack_array(DOFS),
    stack_array(FINGERS),
)


@inner
def _jacobian_column(axis, origin, x, y, z):
    rx, ry, rz = x - origin[0], y - origin[1], z - origin[2]
    return axis[1] * rz - axis[2] * ry, axis[2] * rx - axis[0] * rz, axis[0] * ry - axis[1] * rx


@inner
def _add_targets(finger, positions, axes, targets, normal, slope):
    columns = _columns()
    for j in MOVED_JOINTS[finger]:
        if j < 0:
            continue
        for k in range(DOFS):
            dof = DOFS * finger + k
            columns[k, 0] = columns[k, 1] = columns[k, 2] = 0.0
            if dof_moves(dof, PARENTS[j]):
                x, y, z = _jacobian_column(
                    axes[dof], positions[DOF_JOINTS[dof]], positions[j, 0], positions[j, 1], positions[j, 2]
                )
                columns[k, 0], columns[k, 1], columns[k, 2] = x, y, z
        for a in range(DOFS):
            for i in range(3):
                slope[a] += TARGET_WEIGHT * columns[a, i] * (targets[j, i] - positions[j, i])
            for b in range(DOFS):
                for i in range(3):
                    normal[a, b] += TARGET_WEIGHT * columns[a, i] * columns[b, i]


@inner
def _add_surface(finger, positions, axes, distances, grip, field, rotation, translation, scale, normal, slope):
    row = _numbers()
    reach = PULL_REACH_M + grip * (GRIP_REACH_M - PULL_REACH_M)
    for c in CAPSULES[finger]:
        start, end, radius = CAPSULE_STARTS[c], CAPSULE_ENDS[c], CAPSULE_RADII[c]
        clearance = min(distances[start], distances[end]) - radius
        touching = max(min(1.0 - clearance / CONTACT_MARGIN_M, 1.0), GRIP_SHARE * grip)
        for s in range(SAMPLES):
            f = (s + 0.5) / SAMPLES
            x = positions[start, 0] + f * (positions[end, 0] - positions[start, 0])
            y = positions[start, 1] + f * (positions[end, 1] - positions[start, 1])
            z = positions[start, 2] + f * (positions[end, 2] - positions[start, 2])
            px, py, pz = map_point(rotation, translation, scale, x, y, z)
            distance, gx, gy, gz = field_distance(field, px, py, pz)
            depth = radius - ALLOWED_DEPTH_M - distance * scale
            weight = SURFACE_WEIGHT
            if depth <= 0.0:
                weight = PULL_WEIGHT * touching * max(1.0 + depth / reach, 0.0) ** 2
                if weight == 0.0:
                    continue
            nx, ny, nz = map_direction_back(rotation, gx, gy, gz)
            for k in range(DOFS):
                dof = DOFS * finger + k
                row[k] = 0.0
                if dof_moves(dof, start):
                    jx, jy, jz = _jacobian_column(axes[dof], positions[DOF_JOINTS[dof]], x, y, z)
                    row[k] = nx * jx + ny * jy + nz * jz
            for a in range(DOFS):
                slope[a] += weight * row[a] * depth
                for b in range(DOFS):
                    normal[a, b] += weight * row[a] * row[b]


@inner
def _solve_in_place(normal, slope):
    """Cholesky solve of the positive definite 4 x 4 system; the solution replaces `slope`."""
    for i in range(DOFS):
        for j in range(i + 1):
            total = normal[i, j]
            for k in range(j):
                total -= normal[i, k] * normal[j, k]
            normal[i, j] = np.sqrt(total) if i == j else total / normal[j, j]
    for i in range(DOFS):
        for k in range(i):
            slope[i] -= normal[i, k] * slope[k]
        slope[i] /= normal[i, i]
    for i in range(DOFS - 1, -1, -1):
        for k in range(i + 1, DOFS):
            slope[i] -= normal[k, i] * slope[k]
        slope[i] /= normal[i, i]


@inner
def solve_least_squares(predicted, targets, distances, hold, limits, field, rotation, translation, scale, angles):
    """From a first guess in `angles (20,)` to better ones there: near the angles `predicted (20,)`, toward joint
    `targets (22, 3)`, inside `limits (20, 2)`, out of the object, and onto it where predicted `distances (22,)` or the
    share `hold` of a grip say so."""
    positions, rotations, axes = _positions(), _rotations(), _axes()
    normal, slope, grip = _square(), _numbers(), _grip()
    grip_into(distances, hold, grip)
    push_out_deep_fingers(angles, limits, field, rotation, translation, scale, positions, rotations, axes)
    for _ in range(ITERATIONS):
        forward_kinematics_into(angles, positions, rotations, axes)
        for finger in range(FINGERS):
            normal[:] = 0.0
            for k in range(DOFS):
                dof = DOFS * finger + k
                normal[k, k] = STAY_WEIGHT_M2 + 1e-9
                slope[k] = STAY_WEIGHT_M2 * (predicted[dof] - angles[dof])
            _add_targets(finger, positions, axes, targets, normal, slope)
            _add_surface(
                finger, positions, axes, distances, grip[finger], field, rotation, translation, scale, normal, slope
            )
            _solve_in_place(normal, slope)
            for k in range(DOFS):
                dof = DOFS * finger + k
                step = min(max(slope[k], -_MAX_STEP_RAD), _MAX_STEP_RAD)
                angles[dof] = clamp(angles[dof] + step, limits, dof)
