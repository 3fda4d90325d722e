"""The grip: which fingers must touch so that an object that is held does not fall.

A hand that moves with an object holds it. The contacts of all hands that hold it must be able to carry its weight, with
a margin; where they cannot, one finger a tick gets the pose nearest to the network's that helps most. Fingers that
carry keep their pose until the hand lets go.
"""

from typing import NamedTuple

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, matrix, stack_array, vector
from manipnet.synthesis.hand.hand import (
    CHAIN_LENGTH,
    MAX_ANGLES,
    MAX_CAPSULES,
    MAX_FINGERS,
    MAX_JOINTS,
    Chains,
    Skeleton,
)
from manipnet.synthesis.hand.kinematics import forward_kinematics_into, pose_finger_into
from manipnet.synthesis.ik.chains import Surface, capsule_sample, clamp
from manipnet.synthesis.ik.contacts import EDGES, LOOK_M, TOUCH_M, add_wrenches, capsule_contact
from manipnet.synthesis.ik.nnls import SIZE, unexplained
from manipnet.synthesis.model.features import Windows
from manipnet.synthesis.model.layout import PRESENT
from manipnet.synthesis.objects.shape import Solid
from manipnet.synthesis.sensing.scene import object_from_wrist
from manipnet.synthesis.ik.grasp import ARM_M, grasp_confidence
from manipnet.synthesis.rotations import quat_to_matrix_into

HELD, CURSOR, SPARE, FAILS = 0, 1, 2, 3
HEAD = 4
MAX_HANDS = 4
GRAVITY_M_S2 = 9.81
MARGIN = 0.2
"""Share of its weight by which a held object is pushed aside, in four directions."""
ENOUGH_M_S2 = 0.08 * GRAVITY_M_S2
TAKE_CONFIDENCE, LEAVE_CONFIDENCE = 0.5, 0.1
LEAVES_M = 0.012
"""A hand whose nearest finger is predicted to be farther than this from the object lets go."""
SETTLE_TICKS = 14.0
PACE = 0.35
POSTURE_COST = 4.0
TOUCH_BONUS = 0.3
CANDIDATES = 12
BETTER_M_S2 = 0.2
NEARBY = 0.6
LOCK = False
PATIENCE, PLAIN_COUNTS = 5.0, 5.0
ANCHOR_GAP_M, ANCHOR_REACH_M, FOLLOW = 0.004, 0.012, 0.05
HELD_TICKS = 14
_columns = stack_array(MAX_HANDS * MAX_CAPSULES * EDGES, SIZE)
_shares = stack_array(MAX_HANDS * MAX_CAPSULES * EDGES)
_wanted, _contact = stack_array(SIZE), stack_array(8)
_contacts = stack_array(MAX_HANDS, MAX_CAPSULES, 8)
_rotation_all, _translation_all = stack_array(MAX_HANDS, 3, 3), stack_array(MAX_HANDS, 3)
_positions, _rotations, _axes = stack_array(MAX_JOINTS, 3), stack_array(MAX_JOINTS, 3, 3), stack_array(MAX_ANGLES, 3)
_angles, _best_cost, _best_pose = stack_array(MAX_ANGLES), stack_array(CANDIDATES), stack_array(CANDIDATES, CHAIN_LENGTH)
_carrying = stack_array(MAX_FINGERS)


class Grip(NamedTuple):
    """What one hand remembers of its grip."""

    head: Array
    """`(3,)`: whether it holds; the finger to look at next."""
    ages: Array
    """`(F,)` ticks since a finger was given its pose; 0 for a finger that follows the network."""
    weights: Array
    """`(F,)` how much of its own pose a finger has, 0 to 1."""
    poses: Array
    """`(A,)` that pose, radians."""
    offsets: Array
    """`(A,)` what is added to the network's angles at present, radians."""
    speeds: Array
    """`(A,)` how that changes, radians per tick."""
    anchors: Array
    """`(4 F,)` per finger: how firmly its tip is held in place, 0 to 1, and that place in the object's own metres."""


def grip_size(fingers: int, angles: int) -> int:
    """Numbers that one hand remembers."""
    return HEAD + 6 * fingers + 3 * angles


@inner
def unpack_grip(numbers: Array, fingers: int):
    """A row of `Poses.grip` as a `Grip`."""
    first, angles = HEAD + 2 * fingers, (len(numbers) - HEAD - 6 * fingers) // 3
    return Grip(
        numbers[:HEAD],
        numbers[HEAD : HEAD + fingers],
        numbers[HEAD + fingers : first],
        numbers[first : first + angles],
        numbers[first + angles : first + 2 * angles],
        numbers[first + 2 * angles : first + 3 * angles],
        numbers[first + 3 * angles :],
    )


@inner
def _same_object(windows: Windows, n: int, m: int):
    for i in range(7):
        if abs(abs(windows.object[n, PRESENT, i]) - abs(windows.object[m, PRESENT, i])) > 1e-9:
            return False
    flip = 1.0 if windows.mirrored[n] == windows.mirrored[m] else -1.0
    return abs(windows.object[n, PRESENT, 0] - flip * windows.object[m, PRESENT, 0]) < 1e-9


@inner
def _moved(obj: Array, start: int, stop: int):
    """How far the object `(21, 7)` moves between two samples of the window, metres, turning included."""
    far = turned = ahead = 0.0
    for i in range(3):
        far += (obj[stop, i] - obj[start, i]) ** 2
        turned += (obj[stop, 3 + i] - obj[start, 3 + i]) ** 2
        ahead += (obj[stop, 3 + i] + obj[start, 3 + i]) ** 2
    w, v = (obj[stop, 6] - obj[start, 6]) ** 2, (obj[stop, 6] + obj[start, 6]) ** 2
    return np.sqrt(far) + 2.0 * ARM_M * np.sqrt(min(turned + w, ahead + v))


@inner
def _update_hold(chains: Chains, windows: Windows, n: int, predicted: Array, distances: Array, grip: Grip):
    """Whether hand `n` holds its object, with hysteresis; advances the ages and weights of its fingers."""
    confidence = grasp_confidence(windows.wrist[n], windows.object[n], windows.other_wrist[n])
    nearest = np.inf
    for c in range(len(chains.radii)):
        if chains.starts[c] > 0:
            nearest = min(nearest, min(distances[chains.starts[c]], distances[chains.ends[c]]) - chains.radii[c])
    if confidence > TAKE_CONFIDENCE:
        grip.head[HELD] = min(grip.head[HELD] + 1.0, 60.0)
    elif confidence < LEAVE_CONFIDENCE and nearest > LEAVES_M:
        grip.head[HELD] = 0.0
    for finger in range(len(grip.ages)):
        away = np.inf
        for k in range(CHAIN_LENGTH):
            c = chains.capsules[finger, k]
            if c >= 0:
                away = min(away, min(distances[chains.starts[c]], distances[chains.ends[c]]) - chains.radii[c])
        if grip.head[HELD] == 0.0:
            grip.anchors[4 * finger] *= 0.8
        if grip.head[HELD] == 0.0 or (away > LEAVES_M and confidence < TAKE_CONFIDENCE):
            grip.ages[finger] = 0.0
        chosen = grip.ages[finger] > 0.0
        if chosen:
            grip.ages[finger] += 1.0
        grip.weights[finger] += 0.15 * ((1.0 if chosen else 0.0) - grip.weights[finger])
        for k in range(CHAIN_LENGTH):
            a = chains.angles[finger, k]
            if a >= 0:
                wanted = grip.poses[a] - predicted[a] if chosen else 0.0
                grip.speeds[a] += PACE * (PACE * (wanted - grip.offsets[a]) - 2.0 * grip.speeds[a])
                grip.offsets[a] += grip.speeds[a]


@inner
def _gravity(obj: Array, mirrored: bool, out: Array):
    """The force that must be supplied against gravity, in the object's own axes, and two directions across it."""
    turn = matrix()
    quat_to_matrix_into(obj[3:], turn)
    for axis in range(3):
        # the row of the world's y axis first, then x and z
        row = 1 if axis == 0 else (0 if axis == 1 else 2)
        for i in range(3):
            flip = -1.0 if mirrored and i == 0 else 1.0
            out[axis, i] = flip * turn[row, i]


@inner
def _worst(columns: Array, count: int, directions: Array, shares: Array, wanted: Array):
    """The largest part of the weight, pushed aside by `MARGIN`, that the contacts leave unexplained; `shares` adds up
    what each column supplies."""
    total = unexplained_for(columns, count, directions, 0.0, 0.0, shares, wanted)
    if total > ENOUGH_M_S2:
        return total
    for k in range(4):
        aside = MARGIN if k % 2 == 0 else -MARGIN
        one = unexplained_for(
            columns, count, directions, aside if k < 2 else 0.0, aside if k >= 2 else 0.0, shares, wanted
        )
        total = max(total, one)
    return total


@inner
def unexplained_for(columns, count, directions, x, z, shares, wanted):
    for i in range(3):
        wanted[i] = GRAVITY_M_S2 * (directions[0, i] + x * directions[1, i] + z * directions[2, i])
        wanted[3 + i] = 0.0
    return unexplained(columns, count, wanted, 0.5 * ENOUGH_M_S2, shares)


@inner
def _try(reference: Array, limits: Array, angle: int, index: int, count: int, wide: bool):
    """One of `count` values to try for an angle: over its whole range, or about the reference, finest near it."""
    if wide:
        low, high = max(limits[angle, 0], -0.3), limits[angle, 1]
        return low + (high - low) * index / (count - 1.0)
    away = index - count // 2
    size = 2.0 * abs(away) / (count - 1.0)
    return clamp(reference[angle] + (NEARBY if count > 3 else 0.5 * NEARBY) * size * size * (1.0 if away > 0 else -1.0), limits, angle)


@inner
def _search(
    skeleton: Skeleton,
    chains: Chains,
    limits: Array,
    surface: Surface,
    finger: int,
    wide: bool,
    reference: Array,
    angles: Array,
    positions: Array,
    rotations: Array,
    axes: Array,
    costs: Array,
    rows: Array,
):
    """The poses of a finger that touch the surface, cheapest first: `costs (K,)`, `rows (K, 4)`; returns their number."""
    found = 0
    c0, c1, c2, c3 = chains.angles[finger]
    thumb = finger == 0
    n0, n1, n2, n3 = (5, 5, 5, 3) if thumb else (9, 3, 9, 1)
    for i0 in range(n0 if c0 >= 0 else 1):
        for i1 in range(n1 if c1 >= 0 else 1):
            for i2 in range(n2 if c2 >= 0 else 1):
                for i3 in range(n3 if c3 >= 0 else 1):
                    if c0 >= 0:
                        angles[c0] = _try(reference, limits, c0, i0, n0, wide)
                    if c1 >= 0:
                        angles[c1] = _try(reference, limits, c1, i1, n1, wide)
                    if c2 >= 0:
                        angles[c2] = _try(reference, limits, c2, i2, n2, wide)
                    if c3 >= 0:
                        if thumb:
                            angles[c3] = _try(reference, limits, c3, i3, n3, wide)
                        elif wide:
                            angles[c3] = clamp(0.6 * angles[c2], limits, c3)
                        else:
                            angles[c3] = clamp(reference[c3] + 0.5 * (angles[c2] - reference[c2]), limits, c3)
                    cost = 0.0
                    for k in range(CHAIN_LENGTH):
                        a = chains.angles[finger, k]
                        if a >= 0:
                            weight = 1.5 if k == 1 else (0.3 if k == 3 else 1.0)
                            cost += weight * (angles[a] - reference[a]) ** 2
                    if found == CANDIDATES and cost - CHAIN_LENGTH * TOUCH_BONUS >= costs[found - 1]:
                        continue
                    pose_finger_into(skeleton, chains, finger, angles, positions, rotations, axes)
                    least = np.inf
                    for k in range(CHAIN_LENGTH):
                        c = chains.capsules[finger, k]
                        if c < 0:
                            continue
                        gap = np.inf
                        for s in range(5):
                            gap = min(gap, capsule_sample(chains, c, s / 4.0, positions, surface)[3])
                        gap -= chains.radii[c]
                        least = min(least, gap)
                        if gap < TOUCH_M:
                            cost -= TOUCH_BONUS
                    if least < -0.0025 or least > TOUCH_M:
                        continue
                    at = found if found < CANDIDATES else CANDIDATES - 1
                    if found == CANDIDATES and cost >= costs[at]:
                        continue
                    while at > 0 and costs[at - 1] > cost:
                        costs[at] = costs[at - 1]
                        for k in range(CHAIN_LENGTH):
                            rows[at, k] = rows[at - 1, k]
                        at -= 1
                    costs[at] = cost
                    for k in range(CHAIN_LENGTH):
                        a = chains.angles[finger, k]
                        rows[at, k] = angles[a] if a >= 0 else 0.0
                    found = min(found + 1, CANDIDATES)
    return found


@inner
def _hand_wrenches(contacts: Array, chains: Chains, skip: int, solid: Solid, scale: float, columns: Array, count: int):
    """Add what the capsules of one hand can supply, except those of the finger `skip`."""
    for c in range(len(chains.radii)):
        if contacts[c, 0] < TOUCH_M and (skip < 0 or contacts[c, 7] != skip):
            count = add_wrenches(contacts[c], solid.center_of_mass, scale, columns, count)
    return count


@inner
def _hold_tips(chains, contacts, positions, rotation, translation, scale, grip):
    """Fingertips that touch stay where they touch; the place follows slowly."""
    for finger in range(len(grip.ages)):
        capsule, joint = -1, -1
        for k in range(CHAIN_LENGTH):
            if chains.capsules[finger, k] >= 0:
                capsule = chains.capsules[finger, k]
            if chains.joints[finger, k] >= 0:
                joint = chains.joints[finger, k]
        anchor = grip.anchors[4 * finger : 4 * finger + 4]
        p = positions[joint]
        gap = contacts[capsule, 0] if capsule >= 0 else np.inf
        if anchor[0] == 0.0 and gap > ANCHOR_GAP_M:
            continue
        far = 0.0
        for i in range(3):
            at = rotation[i, 0] * p[0] + rotation[i, 1] * p[1] + rotation[i, 2] * p[2] + translation[i]
            at /= scale
            if anchor[0] == 0.0:
                anchor[1 + i] = at
            far += (at - anchor[1 + i]) ** 2
            anchor[1 + i] += FOLLOW * (at - anchor[1 + i])
        keep = gap < 2.0 * ANCHOR_GAP_M and far * scale * scale < ANCHOR_REACH_M**2
        anchor[0] += 0.2 * ((1.0 if keep else 0.0) - anchor[0])
        if anchor[0] < 0.05:
            anchor[0] = 0.0


@inner
def improve_grips(
    skeleton: Skeleton,
    chains: Chains,
    limits: Array,
    solid: Solid,
    windows: Windows,
    first: int,
    last: int,
    predicted: Array,
    poses_angles: Array,
    distances: Array,
    grips: Array,
):
    """Look after the grips of hands `first … last - 1`: `predicted (N, A)`, their angles `(N, A)`, `grips (N, G)`."""
    fingers = len(chains.angles)
    for n in range(first, last):
        _update_hold(chains, windows, n, predicted[n], distances[n], unpack_grip(grips[n], fingers))
    for n in range(first, last):
        seen = False
        for m in range(first, n):
            seen = seen or _same_object(windows, n, m)
        if not seen:
            _improve_object(
                skeleton, chains, limits, solid, windows, n, last, predicted, poses_angles, grips
            )


@inner
def _improve_object(
    skeleton, chains, limits, solid, windows, first, last, predicted, poses_angles, grips
):
    fingers = len(chains.angles)
    columns, shares, wanted = _columns(), _shares(), _wanted()
    contacts, directions = _contacts(), matrix()
    rotation_all, translation_all = _rotation_all(), _translation_all()
    positions, rotations, axes, angles = _positions(), _rotations(), _axes(), _angles()
    carrying, costs, rows = _carrying(), _best_cost(), _best_pose()
    members = stack_members()
    hands = 0
    for m in range(first, last):
        if hands < MAX_HANDS and grips[m, HELD] >= HELD_TICKS and (m == first or _same_object(windows, first, m)):
            members[hands] = m
            hands += 1
    if hands == 0:
        return
    _gravity(windows.object[first, PRESENT], windows.mirrored[first], directions)
    scale = windows.scale[first]
    count = 0
    for h in range(hands):
        m = int(members[h])
        grip = unpack_grip(grips[m], fingers)
        for a in range(len(limits)):
            angles[a] = poses_angles[m, a]
        for finger in range(fingers):
            if 0.0 < grip.ages[finger] < SETTLE_TICKS:
                for k in range(CHAIN_LENGTH):
                    a = chains.angles[finger, k]
                    if a >= 0:
                        angles[a] = grip.poses[a]
        forward_kinematics_into(skeleton, angles, positions, rotations, axes)
        object_from_wrist(
            windows.wrist[m, PRESENT], windows.object[m, PRESENT], windows.mirrored[m], rotation_all[h], translation_all[h]
        )
        surface = Surface(solid.field, rotation_all[h], translation_all[h], scale)
        for c in range(len(chains.radii)):
            capsule_contact(chains, c, positions, surface, solid, contacts[h, c])
            contacts[h, c, 7] = -1.0
        for finger in range(fingers):
            for k in range(CHAIN_LENGTH):
                if chains.capsules[finger, k] >= 0:
                    contacts[h, chains.capsules[finger, k], 7] = finger
        count = _hand_wrenches(contacts[h], chains, -1, solid, scale, columns, count)
        _hold_tips(chains, contacts[h], positions, rotation_all[h], translation_all[h], scale, grip)
    plain = unexplained_for(columns, count, directions, 0.0, 0.0, shares, wanted)
    left = _worst(columns, count, directions, shares, wanted)
    for h in range(hands):
        grips[int(members[h]), SPARE] = left
    m0 = int(members[0])
    grips[m0, FAILS] = 0.0 if left <= ENOUGH_M_S2 else grips[m0, FAILS] + (1.0 if plain <= ENOUGH_M_S2 else PLAIN_COUNTS)
    if left <= ENOUGH_M_S2:
        column = 0
        for h in range(hands):
            m = int(members[h])
            grip = unpack_grip(grips[m], fingers)
            for finger in range(fingers):
                carrying[finger] = 0.0
            for c in range(len(chains.radii)):
                if contacts[h, c, 0] < TOUCH_M:
                    for edge in range(EDGES):
                        if contacts[h, c, 7] >= 0.0:
                            carrying[int(contacts[h, c, 7])] += shares[column + edge]
                    column += EDGES
            for finger in range(fingers):
                if LOCK and carrying[finger] > 0.0 and grip.ages[finger] == 0.0:
                    grip.ages[finger] = SETTLE_TICKS
                    for k in range(CHAIN_LENGTH):
                        a = chains.angles[finger, k]
                        if a >= 0:
                            grip.poses[a] = poses_angles[m, a]
        return
    obj = windows.object[first]
    future, past = _moved(obj, PRESENT, PRESENT + 3), _moved(obj, PRESENT - 3, PRESENT)
    if future < 0.004 and past > 0.002:
        return
    if grips[m0, FAILS] < PATIENCE:
        return
    # one finger a tick: the hands in turn, each from the thumb on
    turn = int(grips[m0, CURSOR])
    wide = turn >= hands * fingers
    grips[m0, CURSOR] = (turn + 1) % (2 * hands * fingers)
    turn = turn % (hands * fingers)
    h, finger = turn % hands, turn // hands
    m = int(members[h])
    grip = unpack_grip(grips[m], fingers)
    if 0.0 < grip.ages[finger] < SETTLE_TICKS:
        return
    count = 0
    for other in range(hands):
        count = _hand_wrenches(
            contacts[other], chains, finger if other == h else -1, solid, scale, columns, count
        )
    for a in range(len(limits)):
        angles[a] = poses_angles[m, a]
    forward_kinematics_into(skeleton, angles, positions, rotations, axes)
    surface = Surface(solid.field, rotation_all[h], translation_all[h], scale)
    found = _search(
        skeleton, chains, limits, surface, finger, wide, predicted[m], angles, positions, rotations, axes, costs, rows
    )
    contact = _contact()
    best, chosen = left - BETTER_M_S2, -1
    for row in range(found):
        for k in range(CHAIN_LENGTH):
            a = chains.angles[finger, k]
            if a >= 0:
                angles[a] = rows[row, k]
        pose_finger_into(skeleton, chains, finger, angles, positions, rotations, axes)
        with_it = count
        for k in range(CHAIN_LENGTH):
            c = chains.capsules[finger, k]
            if c >= 0:
                capsule_contact(chains, c, positions, surface, solid, contact)
                if contact[0] < TOUCH_M:
                    with_it = add_wrenches(contact, solid.center_of_mass, scale, columns, with_it)
        score = _worst(columns, with_it, directions, shares, wanted) + POSTURE_COST * max(costs[row], 0.0)
        if score < best:
            best, chosen = score, row
    if chosen >= 0:
        grips[m0, CURSOR] = 0.0 if left < ENOUGH_M_S2 else grips[m0, CURSOR]
        grip.ages[finger] = 1.0
        for k in range(CHAIN_LENGTH):
            a = chains.angles[finger, k]
            if a >= 0:
                grip.poses[a] = rows[chosen, k]


stack_members = stack_array(MAX_HANDS)
