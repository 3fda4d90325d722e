"""Contact carried from the model's hand onto an avatar's: every point of the avatar's fingers keeps the gap to the
object that its counterpart on the model's hand has.

Both hands are sampled at the same places along their capsules and at the pads of the fingertips. A sample that touches
weighs most, and one that is far away not at all, so the fingers of a free hand only follow the model's angles. The
fingers are independent of each other, except that all of them move with the wrist, which may be shifted where the
fingers alone cannot reach. A few Gauss-Newton steps from the last tick's solution solve this, each finger with at most
four unknowns and the wrist with three (its Schur complement).
"""

from typing import NamedTuple

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, kernel, matrix, stack_array, vector
from manipnet.synthesis.hand.hand import CHAIN_LENGTH, MAX_ANGLES, MAX_FINGERS, MAX_JOINTS, Chains, Indices, Skeleton
from manipnet.synthesis.hand.kinematics import forward_kinematics_into
from manipnet.synthesis.hand.packed import unpack_chains, unpack_skeleton
from manipnet.synthesis.ik.chains import angle_moves, clamp
from manipnet.synthesis.objects.distance_field import Field, field_distance
from manipnet.synthesis.sensing.scene import map_direction_back, map_point, object_from_wrist

MAX_SAMPLES = 128
SHARED_ITERATIONS, FINGER_ITERATIONS = 1, 2
"""Steps that move the wrist with the fingers, and steps of the fingers alone about the wrist as it is shown."""
REACH_M = 0.025
"""A counterpart that is farther from the object than this is free."""
TOUCHING_M, FREE_M = 0.003, 0.012
"""Up to the first gap a sample of the model's hand touches, beyond the second it is free of the object."""
TOUCHING_SHARE = 0.65
"""Samples that touch are to have this share of the gap, or depth, of their counterparts, so that none is lost."""
CONTACT_WEIGHT = 4.0
TIP_WEIGHT = 6.0
PAD_WEIGHT = 9.0
DEPTH_WEIGHT = 6.0
"""Push on a sample that is deeper than its counterpart."""
SLIDE_WEIGHT = 0.15
"""Pull of a touching pad toward the place where the model's pad is."""
STAY_WEIGHT_M2 = 5e-4
"""Pull toward the model's angles, in square metres per square radian."""
CALM_WEIGHT_M2 = 1.3e-2
"""Pull toward the last tick's difference from the model's angles, for a hand of the model's length."""
WRIST_WEIGHT = 0.35
"""Pull of the wrist toward where it is tracked."""
WRIST_PACE = 0.15
"""Share of the way to a new shift of the wrist that one tick goes."""
MAX_SHIFT_M = 0.03
_MAX_STEP_RAD = 0.2

_positions, _rotations, _axes = stack_array(MAX_JOINTS, 3), stack_array(MAX_JOINTS, 3, 3), stack_array(MAX_ANGLES, 3)
_reference, _gaps, _weights = stack_array(MAX_ANGLES), stack_array(MAX_SAMPLES), stack_array(MAX_SAMPLES)
_points, _normals = stack_array(MAX_SAMPLES, 3), stack_array(MAX_SAMPLES, 3)
_normal, _slope = stack_array(MAX_FINGERS, CHAIN_LENGTH, CHAIN_LENGTH), stack_array(MAX_FINGERS, CHAIN_LENGTH)
_mixed, _row, _square = stack_array(MAX_FINGERS, CHAIN_LENGTH, 3), stack_array(CHAIN_LENGTH), stack_array(4, 4)
_solved = stack_array(CHAIN_LENGTH, 4)


class Samples(NamedTuple):
    """Places on the avatar's hand and their counterparts on the model's, sorted by finger; those of the palm are last.

    A place is `joint + fraction · (end − joint) + R_bone · offset`, a `radius` away from the skin.
    """

    first: Indices
    """`(F + 2,)` where the samples of each finger begin, then those of the palm, then the end."""
    joints: Indices
    """`(S, 4)` start and end joint on the avatar, start and end joint on the model."""
    fractions: Array
    """`(S, 2)` on the avatar and on the model."""
    offsets: Array
    """`(S, 2, 3)` in the frame of the start joint's bone."""
    radii: Array
    """`(S, 2)`"""
    weights: Array
    """`(S,)`"""
    pads: Indices
    """`(F,)` the sample that is the pad of each finger."""


@inner
def _wanted_gap(gap: float):
    """The gap that the avatar's sample is to have where its counterpart has `gap`: touching ones go nearer to zero."""
    if gap <= 0.0:
        return TOUCHING_SHARE * gap
    free = min(max((gap - TOUCHING_M) / (FREE_M - TOUCHING_M), 0.0), 1.0)
    return gap * (TOUCHING_SHARE + (1.0 - TOUCHING_SHARE) * free * free * (3.0 - 2.0 * free))


@inner
def _place(samples: Samples, s: int, which: int, positions: Array, rotations: Array, out: Array):
    """Sample `s` of the avatar (`which` 0) or of the model (1), in the wrist frame, into `out (3,)`."""
    start, end = samples.joints[s, 2 * which], samples.joints[s, 2 * which + 1]
    fraction, offset = samples.fractions[s, which], samples.offsets[s, which]
    for i in range(3):
        out[i] = positions[start, i] + fraction * (positions[end, i] - positions[start, i])
        out[i] += rotations[start, i, 0] * offset[0] + rotations[start, i, 1] * offset[1]
        out[i] += rotations[start, i, 2] * offset[2]


@inner
def _field_at(field: Field, rotation: Array, translation: Array, scale: float, point: Array, normal: Array):
    """The distance of a point of the wrist frame to the object; the direction away from it into `normal (3,)`."""
    x, y, z = map_point(rotation, translation, scale, point[0], point[1], point[2])
    distance, gx, gy, gz = field_distance(field, x, y, z)
    normal[0], normal[1], normal[2] = map_direction_back(rotation, gx, gy, gz)
    return distance * scale


@inner
def _solve_finger(square: Array, sides: Array):
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
def _row_of(
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
def _add(row: Array, n: Array, apart: float, weight: float, normal: Array, slope: Array, mixed: Array, wrist, pull):
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
def _invert_wrist(wrist: Array, pull: Array, out: Array):
    """Solve the symmetric 3 x 3 system by Cramer's rule, into `out (3,)`."""
    a, b, c, d, e, f = wrist[0, 0], wrist[0, 1], wrist[0, 2], wrist[1, 1], wrist[1, 2], wrist[2, 2]
    p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
    size = 1.0 / (a * p + b * q + c * r)
    out[0] = (p * pull[0] + q * pull[1] + r * pull[2]) * size
    out[1] = (q * pull[0] + (a * f - c * c) * pull[1] + (b * c - a * e) * pull[2]) * size
    out[2] = (r * pull[0] + (b * c - a * e) * pull[1] + (a * d - b * b) * pull[2]) * size


@kernel
def carry_contacts(
    model: np.ndarray,
    avatar: np.ndarray,
    samples: Samples,
    follow: Array,
    limits: Array,
    field: Field,
    wrist: Array,
    obj: Array,
    mirrored: bool,
    scale: float,
    size: float,
    touching: float,
    max_shift_m: float,
    model_angles: Array,
    pace: float,
    calm_weight_m2: float,
    followed: Array,
    before: Array,
    angles: Array,
    shift: Array,
):
    """The angles `(A,)` of the avatar's hand beside an object, and the `shift (3,)` of its wrist in the wrist frame.

    `wrist` and `obj` are poses `(7,)` of the scene, both mirrored for a left hand; `size` is the size of the actor's
    hand relative to the model's. `touching` is how much contact counts, 0 to 1. `followed (A,)`, `before (A,)` and
    `shift` are replaced: the model's angles as the avatar follows them, at its `pace`, the difference that contact
    makes, which changes against the pull of `calm_weight_m2`, and the shift, all of the last tick.
    """
    skeleton, chains = unpack_skeleton(avatar), unpack_chains(avatar)
    theirs = unpack_skeleton(model)
    positions, rotations, axes = _positions(), _rotations(), _axes()
    reference, gaps, weights = _reference(), _gaps(), _weights()
    points, normals = _points(), _normals()
    rotation, translation, point, n = matrix(), vector(), vector(), vector()
    fingers, total = len(chains.angles), samples.first[len(samples.first) - 1]
    object_from_wrist(wrist, obj, mirrored, rotation, translation)

    forward_kinematics_into(theirs, model_angles, positions, rotations, axes)
    for s in range(total):
        _place(samples, s, 1, positions, rotations, points[s])
        for i in range(3):
            points[s, i] *= size
        gaps[s] = _field_at(field, rotation, translation, scale, points[s], normals[s]) - size * samples.radii[s, 1]
        nearness = min(max(1.0 - max(gaps[s], 0.0) / REACH_M, 0.0), 1.0)
        weights[s] = touching * samples.weights[s] * nearness * nearness
        # the point of the counterpart is moved along with its gap, for the plane below
        move = _wanted_gap(gaps[s]) - gaps[s]
        for i in range(3):
            points[s, i] += move * normals[s, i]
        gaps[s] += move

    for a in range(len(angles)):
        target = 0.0
        for k in range(len(model_angles)):
            target += follow[a, k] * model_angles[k]
        followed[a] += pace * (target - followed[a])
        reference[a] = followed[a]
        angles[a] = clamp(reference[a] + before[a], limits, a)

    normal, slope, mixed = _normal(), _slope(), _mixed()
    row, square, sides = _row(), _square(), _solved()
    whole, pull, move, wanted = matrix(), vector(), vector(), vector()
    for i in range(3):
        wanted[i] = shift[i]
    for iteration in range(SHARED_ITERATIONS + FINGER_ITERATIONS):
        shared = iteration < SHARED_ITERATIONS
        if iteration == SHARED_ITERATIONS:
            length = np.sqrt(wanted[0] ** 2 + wanted[1] ** 2 + wanted[2] ** 2)
            most = min(1.0, max_shift_m / max(length, 1e-9))
            for i in range(3):
                shift[i] += WRIST_PACE * (most * wanted[i] - shift[i])
                wanted[i] = shift[i]
        forward_kinematics_into(skeleton, angles, positions, rotations, axes)
        for i in range(3):
            pull[i] = -WRIST_WEIGHT * wanted[i]
            for j in range(3):
                whole[i, j] = WRIST_WEIGHT if i == j else 0.0
        for finger in range(fingers + 1):
            palm = finger == fingers
            if not palm:
                for k in range(CHAIN_LENGTH):
                    angle = chains.angles[finger, k]
                    for j in range(CHAIN_LENGTH):
                        normal[finger, k, j] = 0.0
                    for j in range(3):
                        mixed[finger, k, j] = 0.0
                    normal[finger, k, k] = STAY_WEIGHT_M2 + calm_weight_m2
                    slope[finger, k] = 0.0
                    if angle >= 0:
                        away = angles[angle] - reference[angle]
                        slope[finger, k] = -STAY_WEIGHT_M2 * away + calm_weight_m2 * (before[angle] - away)
            elif not shared:
                continue
            for s in range(samples.first[finger], samples.first[finger + 1]):
                _place(samples, s, 0, positions, rotations, point)
                for i in range(3):
                    point[i] += wanted[i]
                gap = _field_at(field, rotation, translation, scale, point, n) - samples.radii[s, 0]
                if weights[s] > 0.0 and n[0] * normals[s, 0] + n[1] * normals[s, 1] + n[2] * normals[s, 2] < 0.0:
                    # on the far side of a wall: the plane at the counterpart's contact shows the way back
                    gap = gaps[s] + size * samples.radii[s, 1] - samples.radii[s, 0]
                    for i in range(3):
                        n[i] = normals[s, i]
                        gap += n[i] * (point[i] - points[s, i])
                weight = weights[s]
                apart = gaps[s] - gap
                if gap < 0.0 and apart > 0.0 and samples.radii[s, 0] > 0.0:
                    weight = max(weight, touching * DEPTH_WEIGHT)
                    apart = min(gaps[s], 0.0) - gap
                if weight <= 0.0:
                    continue
                for k in range(CHAIN_LENGTH):
                    row[k] = 0.0
                if palm:
                    for i in range(3):
                        pull[i] += weight * n[i] * apart
                        for j in range(3):
                            whole[i, j] += weight * n[i] * n[j]
                    continue
                for i in range(3):
                    point[i] -= wanted[i]
                bone = samples.joints[s, 0]
                _row_of(skeleton, chains, finger, bone, positions, axes, point, n, row)
                _add(row, n, apart, weight, normal[finger], slope[finger], mixed[finger], whole, pull)
                if s == samples.pads[finger]:
                    for axis in range(3):
                        for i in range(3):
                            n[i] = 1.0 if i == axis else 0.0
                        apart = points[s, axis] - point[axis] - wanted[axis]
                        _row_of(skeleton, chains, finger, bone, positions, axes, point, n, row)
                        slide = SLIDE_WEIGHT * weights[s] / samples.weights[s]
                        _add(row, n, apart, slide, normal[finger], slope[finger], mixed[finger], whole, pull)
        if shared:
            for finger in range(fingers):
                _load(normal[finger], slope[finger], mixed[finger], square, sides)
                _solve_finger(square, sides)
                for i in range(3):
                    for k in range(CHAIN_LENGTH):
                        pull[i] -= mixed[finger, k, i] * sides[k, 0]
                        for j in range(3):
                            whole[i, j] -= mixed[finger, k, i] * sides[k, 1 + j]
            _invert_wrist(whole, pull, move)
            for i in range(3):
                move[i] = min(max(move[i], -0.02), 0.02)
                wanted[i] += move[i]
        else:
            for i in range(3):
                move[i] = 0.0
        for finger in range(fingers):
            _load(normal[finger], slope[finger], mixed[finger], square, sides)
            _solve_finger(square, sides)
            for k in range(CHAIN_LENGTH):
                angle = chains.angles[finger, k]
                if angle >= 0:
                    step = sides[k, 0]
                    for i in range(3):
                        step -= sides[k, 1 + i] * move[i]
                    step = min(max(step, -_MAX_STEP_RAD), _MAX_STEP_RAD)
                    angles[angle] = clamp(angles[angle] + step, limits, angle)
    for a in range(len(angles)):
        before[a] = angles[a] - reference[a]


@inner
def _load(normal: Array, slope: Array, mixed: Array, square: Array, sides: Array):
    """Copy a finger's system, which the solution replaces: the slope, then the three columns of the wrist."""
    for a in range(CHAIN_LENGTH):
        sides[a, 0] = slope[a]
        for j in range(3):
            sides[a, 1 + j] = mixed[a, j]
        for b in range(CHAIN_LENGTH):
            square[a, b] = normal[a, b]
