"""Contact carried from the model's hand onto an avatar's: every point of the avatar's fingers keeps the gap to the
object that its counterpart on the model's hand has.

Both hands are sampled at the same places along their capsules and at the pads of the fingertips. A sample that touches
weighs most, and one that is far away not at all, so the fingers of a free hand only follow the model's angles. The
fingers are independent of each other, except that all of them move with the wrist, which may be shifted where the
fingers alone cannot reach. A few Gauss-Newton steps from the last tick's solution solve this, each finger with at most
four unknowns and the wrist with three (its Schur complement).
"""

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import kernel, matrix, stack_array, vector
from manipnet.synthesis.hand.hand import CHAIN_LENGTH, MAX_ANGLES, MAX_FINGERS, MAX_JOINTS
from manipnet.synthesis.hand.kinematics import forward_kinematics_into
from manipnet.synthesis.hand.packed import unpack_chains, unpack_skeleton
from manipnet.synthesis.ik.carry_equations import add_equation, lever_row, load_finger, solve_finger, solve_wrist
from manipnet.synthesis.ik.carry_samples import MAX_SAMPLES, REACH_M, Samples, field_at, place_sample, wanted_gap
from manipnet.synthesis.ik.chains import clamp
from manipnet.synthesis.objects.distance_field import Field
from manipnet.synthesis.sensing.scene import object_from_wrist

SHARED_ITERATIONS, FINGER_ITERATIONS = 1, 2
"""Steps that move the wrist with the fingers, and steps of the fingers alone about the wrist as it is shown."""
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
        place_sample(samples, s, 1, positions, rotations, points[s])
        for i in range(3):
            points[s, i] *= size
        gaps[s] = field_at(field, rotation, translation, scale, points[s], normals[s]) - size * samples.radii[s, 1]
        nearness = min(max(1.0 - max(gaps[s], 0.0) / REACH_M, 0.0), 1.0)
        weights[s] = touching * samples.weights[s] * nearness * nearness
        # the point of the counterpart is moved along with its gap, for the plane below
        move = wanted_gap(gaps[s]) - gaps[s]
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
                place_sample(samples, s, 0, positions, rotations, point)
                for i in range(3):
                    point[i] += wanted[i]
                gap = field_at(field, rotation, translation, scale, point, n) - samples.radii[s, 0]
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
                lever_row(skeleton, chains, finger, bone, positions, axes, point, n, row)
                add_equation(row, n, apart, weight, normal[finger], slope[finger], mixed[finger], whole, pull)
                if s == samples.pads[finger]:
                    for axis in range(3):
                        for i in range(3):
                            n[i] = 1.0 if i == axis else 0.0
                        apart = points[s, axis] - point[axis] - wanted[axis]
                        lever_row(skeleton, chains, finger, bone, positions, axes, point, n, row)
                        slide = SLIDE_WEIGHT * weights[s] / samples.weights[s]
                        add_equation(row, n, apart, slide, normal[finger], slope[finger], mixed[finger], whole, pull)
        if shared:
            for finger in range(fingers):
                load_finger(normal[finger], slope[finger], mixed[finger], square, sides)
                solve_finger(square, sides)
                for i in range(3):
                    for k in range(CHAIN_LENGTH):
                        pull[i] -= mixed[finger, k, i] * sides[k, 0]
                        for j in range(3):
                            whole[i, j] -= mixed[finger, k, i] * sides[k, 1 + j]
            solve_wrist(whole, pull, move)
            for i in range(3):
                move[i] = min(max(move[i], -0.02), 0.02)
                wanted[i] += move[i]
        else:
            for i in range(3):
                move[i] = 0.0
        for finger in range(fingers):
            load_finger(normal[finger], slope[finger], mixed[finger], square, sides)
            solve_finger(square, sides)
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
