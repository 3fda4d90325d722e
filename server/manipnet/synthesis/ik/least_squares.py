"""Damped least squares over the angles: joints to targets, capsules out of the object, near the network's pose.

Each finger is a problem of at most four unknowns; a few Gauss-Newton steps with a 4 x 4 Cholesky solve are exact enough
and take microseconds. Capsules meet the distance field, not the triangles: it is smooth and has its own gradient.
"""

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, stack_array, vector
from manipnet.synthesis.hand.hand import CHAIN_LENGTH, MAX_ANGLES, MAX_FINGERS, MAX_JOINTS, Chains, Skeleton
from manipnet.synthesis.hand.kinematics import forward_kinematics_into
from manipnet.synthesis.ik.chains import Surface, angle_moves, capsule_sample, clamp
from manipnet.synthesis.ik.depenetration import open_deep_fingers
from manipnet.synthesis.ik.grasp import finger_confidences_into
from manipnet.synthesis.ik.grip import ANCHOR
from manipnet.synthesis.sensing.scene import map_direction_back

ITERATIONS = 4
SAMPLES = 4
"""Points along a capsule's axis that are kept a radius away from the surface."""
TARGET_WEIGHT = 1.0
SURFACE_WEIGHT = 6.0
STAY_WEIGHT_M2 = 4e-5
"""Pull toward the network's angles, in square metres per square radian."""
GRIP_WEIGHT_M2 = 4e-3
"""The same for the angles of a finger that has a pose of its own, because it carries."""
ANCHOR_WEIGHT = 1.5
"""Pull of a fingertip toward the place where it touched the object."""
CLEAR_WEIGHT = 2.0
"""Push on the fingers of a hand that is to keep clear of the object, until they do."""
ALLOWED_DEPTH_M = 0.002
"""Skin gives way: the captured fingers are about this deep where they press."""
PULL_WEIGHT = 3.0
PULL_REACH_M = 0.012
"""Capsules this near the surface are pulled onto it if the network says that they touch."""
CONTACT_MARGIN_M = 0.006
"""A predicted distance of a capsule's radius means contact; this much more means no contact."""
GRASP_SHARE = 0.4
"""Pull on the fingers of a hand that holds, relative to capsules that the network says touch."""
GRASP_REACH_M = 0.030
"""Distance from which the fingers of a hand that holds are pulled onto the surface."""
_MAX_STEP_RAD = 0.2
_positions, _rotations, _axes = stack_array(MAX_JOINTS, 3), stack_array(MAX_JOINTS, 3, 3), stack_array(MAX_ANGLES, 3)
_square, _columns = stack_array(CHAIN_LENGTH, CHAIN_LENGTH), stack_array(CHAIN_LENGTH, 3)
_row, _confidences = stack_array(CHAIN_LENGTH), stack_array(MAX_FINGERS)


@inner
def _jacobian_column(axis: Array, origin: Array, x: float, y: float, z: float):
    """How a point moves when the hinge `axis` through `origin` turns by one radian."""
    rx, ry, rz = x - origin[0], y - origin[1], z - origin[2]
    return axis[1] * rz - axis[2] * ry, axis[2] * rx - axis[0] * rz, axis[0] * ry - axis[1] * rx


@inner
def _add_pull(
    skeleton: Skeleton,
    chains: Chains,
    finger: int,
    joint: int,
    positions: Array,
    axes: Array,
    apart: Array,
    weight: float,
    normal: Array,
    slope: Array,
):
    """Add a joint of the finger, pulled along `apart (3,)`, to its normal equations."""
    columns, bone = _columns(), skeleton.parents[joint]
    x, y, z = positions[joint, 0], positions[joint, 1], positions[joint, 2]
    for a in range(CHAIN_LENGTH):
        angle = chains.angles[finger, a]
        if angle < 0 or not angle_moves(skeleton.angle_bones, angle, bone):
            columns[a, 0] = columns[a, 1] = columns[a, 2] = 0.0
            continue
        cx, cy, cz = _jacobian_column(axes[angle], positions[skeleton.angle_bones[angle]], x, y, z)
        columns[a, 0], columns[a, 1], columns[a, 2] = cx, cy, cz
        slope[a] += weight * (cx * apart[0] + cy * apart[1] + cz * apart[2])
        for b in range(a + 1):
            normal[a, b] += weight * (cx * columns[b, 0] + cy * columns[b, 1] + cz * columns[b, 2])


@inner
def _add_targets(
    skeleton: Skeleton,
    chains: Chains,
    finger: int,
    positions: Array,
    axes: Array,
    targets: Array,
    weight: float,
    normal: Array,
    slope: Array,
):
    """Add the finger's joints, pulled to their `targets (J, 3)`, to its normal equations."""
    apart = vector()
    for k in range(CHAIN_LENGTH):
        joint = chains.joints[finger, k]
        if joint < 0:
            continue
        for i in range(3):
            apart[i] = targets[joint, i] - positions[joint, i]
        _add_pull(skeleton, chains, finger, joint, positions, axes, apart, TARGET_WEIGHT * weight, normal, slope)


@inner
def _add_anchor(
    skeleton: Skeleton,
    chains: Chains,
    finger: int,
    positions: Array,
    axes: Array,
    anchors: Array,
    surface: Surface,
    normal: Array,
    slope: Array,
):
    """Add the fingertip, held at its place on the object, to the finger's normal equations."""
    apart, tip, anchor = vector(), -1, ANCHOR * finger
    for k in range(CHAIN_LENGTH):
        if chains.joints[finger, k] >= 0:
            tip = chains.joints[finger, k]
    r, t = surface.rotation, surface.translation
    for i in range(3):
        apart[i] = -positions[tip, i]
        for j in range(3):
            apart[i] += r[j, i] * (anchors[anchor + 1 + j] * surface.scale - t[j])
    weight = ANCHOR_WEIGHT * anchors[anchor]
    _add_pull(skeleton, chains, finger, tip, positions, axes, apart, weight, normal, slope)


@inner
def _add_surface(
    skeleton: Skeleton,
    chains: Chains,
    finger: int,
    positions: Array,
    axes: Array,
    distances: Array,
    confidence: float,
    clear_m: float,
    surface: Surface,
    normal: Array,
    slope: Array,
):
    """Add the finger's capsules, pushed out of the object and pulled onto it, to its normal equations.

    They are pushed gently until they are `clear_m` away.
    """
    row = _row()
    reach = PULL_REACH_M + confidence * (GRASP_REACH_M - PULL_REACH_M)
    for capsule in range(CHAIN_LENGTH):
        c = chains.capsules[finger, capsule]
        if c < 0:
            continue
        start, radius = chains.starts[c], chains.radii[c]
        clearance = min(distances[start], distances[chains.ends[c]]) - radius
        touching = max(min(1.0 - clearance / CONTACT_MARGIN_M, 1.0), GRASP_SHARE * confidence)
        for s in range(SAMPLES):
            f = (s + 0.5) / SAMPLES
            x, y, z, distance, gx, gy, gz = capsule_sample(chains, c, f, positions, surface)
            depth = radius - ALLOWED_DEPTH_M - distance
            weight = SURFACE_WEIGHT
            if -clear_m < depth <= 0.0:
                depth += clear_m
                weight = CLEAR_WEIGHT
            elif depth <= 0.0:
                weight = PULL_WEIGHT * touching * max(1.0 + depth / reach, 0.0) ** 2
                if weight == 0.0:
                    continue
            nx, ny, nz = map_direction_back(surface.rotation, gx, gy, gz)
            for k in range(CHAIN_LENGTH):
                angle = chains.angles[finger, k]
                row[k] = 0.0
                if angle >= 0 and angle_moves(skeleton.angle_bones, angle, start):
                    jx, jy, jz = _jacobian_column(axes[angle], positions[skeleton.angle_bones[angle]], x, y, z)
                    row[k] = nx * jx + ny * jy + nz * jz
            for a in range(CHAIN_LENGTH):
                slope[a] += weight * row[a] * depth
                for b in range(a + 1):
                    normal[a, b] += weight * row[a] * row[b]


@inner
def _solve_in_place(normal: Array, slope: Array):
    """Cholesky solve of the positive definite 4 x 4 system, of which only the lower triangle is read; the solution
    replaces `slope`."""
    for i in range(CHAIN_LENGTH):
        for j in range(i + 1):
            total = normal[i, j]
            for k in range(j):
                total -= normal[i, k] * normal[j, k]
            normal[i, j] = np.sqrt(total) if i == j else total / normal[j, j]
    for i in range(CHAIN_LENGTH):
        for k in range(i):
            slope[i] -= normal[i, k] * slope[k]
        slope[i] /= normal[i, i]
    for i in range(CHAIN_LENGTH - 1, -1, -1):
        for k in range(i + 1, CHAIN_LENGTH):
            slope[i] -= normal[k, i] * slope[k]
        slope[i] /= normal[i, i]


@inner
def solve_least_squares(
    skeleton: Skeleton,
    chains: Chains,
    predicted: Array,
    targets: Array,
    distances: Array,
    confidence: float,
    clear_m: float,
    limits: Array,
    surface: Surface,
    weights: Array,
    anchors: Array,
    angles: Array,
):
    """From a first guess in `angles (A,)` to better ones there, inside `limits (A, 2)`.

    They stay near the angles `predicted (A,)`, bring joints to `targets (J, 3)`, keep fingers out of the object and
    pull them onto it where the predicted `distances (J,)` or the `confidence` in a grasp say so, or keep them `clear_m`
    away. `weights (F,)` and
    `anchors (F, 4)`, flat, are those of a `Grip`.
    """
    positions, rotations, axes = _positions(), _rotations(), _axes()
    normal, slope, confidences = _square(), _row(), _confidences()
    finger_confidences_into(chains, distances, confidence, confidences)
    open_deep_fingers(skeleton, chains, angles, limits, surface, positions, rotations, axes)
    for _ in range(ITERATIONS):
        forward_kinematics_into(skeleton, angles, positions, rotations, axes)
        for finger in range(len(chains.angles)):
            normal[:] = 0.0
            for k in range(CHAIN_LENGTH):
                angle = chains.angles[finger, k]
                stay = STAY_WEIGHT_M2 + weights[finger] * GRIP_WEIGHT_M2
                normal[k, k] = stay + 1e-9
                slope[k] = stay * (predicted[angle] - angles[angle]) if angle >= 0 else 0.0
            _add_targets(skeleton, chains, finger, positions, axes, targets, 1.0 - weights[finger], normal, slope)
            if anchors[ANCHOR * finger] > 0.0:
                _add_anchor(skeleton, chains, finger, positions, axes, anchors, surface, normal, slope)
            _add_surface(
                skeleton,
                chains,
                finger,
                positions,
                axes,
                distances,
                max(confidences[finger], weights[finger]),
                clear_m,
                surface,
                normal,
                slope,
            )
            _solve_in_place(normal, slope)
            for k in range(CHAIN_LENGTH):
                angle = chains.angles[finger, k]
                if angle >= 0:
                    step = min(max(slope[k], -_MAX_STEP_RAD), _MAX_STEP_RAD)
                    angles[angle] = clamp(angles[angle] + step, limits, angle)
