"""Holding: which fingers must touch so that what a hand holds does not fall.

A hand that moves with an object holds it. The contacts of all hands that hold it must be able to carry its weight, also
when it is pushed aside a little. Where they cannot, one finger a tick gets the nearest pose that helps most, first near
its present pose and then over its whole range. It keeps that pose until the hand lets go.
"""

from typing import NamedTuple

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, matrix, stack_array
from manipnet.synthesis.hand.hand import (
    CHAIN_LENGTH,
    MAX_ANGLES,
    MAX_CAPSULES,
    MAX_JOINTS,
    Chains,
    Skeleton,
)
from manipnet.synthesis.hand.kinematics import forward_kinematics_into, pose_finger_into
from manipnet.synthesis.ik.chains import Surface
from manipnet.synthesis.ik.contacts import CONTACT, EDGES, TOUCH_M, add_wrenches, find_contact
from manipnet.synthesis.ik.finger_poses import MOST_POSES, touching_poses
from manipnet.synthesis.ik.grasp import ARM_M, finger_clearance, grasp_confidence
from manipnet.synthesis.ik.grip import (
    ARRIVING_TICKS,
    FAILED_TICKS,
    HELD_TICKS,
    NEXT_FINGER,
    last_of,
    loosen_anchor,
    move_anchor,
    move_finger,
    take_pose,
    unpack_grip,
)
from manipnet.synthesis.ik.nnls import SIZE, unexplained
from manipnet.synthesis.model.features import Windows
from manipnet.synthesis.model.layout import PRESENT
from manipnet.synthesis.objects.shape import Solid
from manipnet.synthesis.rotations import quat_to_matrix_into
from manipnet.synthesis.sensing.scene import object_from_wrist

MOST_HANDS = 4
"""Hands on one object; more are left as they are."""
GRAVITY_M_S2 = 9.81
PUSHED_ASIDE = 0.2
"""Share of its weight by which the object is pushed to each of four sides."""
ENOUGH_M_S2 = 0.08 * GRAVITY_M_S2
"""What may be left of the weight, per unit of mass."""
TAKES, LEAVES = 0.5, 0.1
"""The confidence in a grasp at which a hand takes the object, and below which it may let go."""
LEAVES_M = 0.012
"""A finger that is predicted to be farther than this from the object lets go."""
TAKEN_TICKS = 14
"""The confidence looks a quarter of a second ahead, so a hand that takes an object has these ticks to close."""
PATIENCE_TICKS = 5
"""A grip that carries the weight but not a push may be that short of it for this long."""
BETTER_M_S2, POSTURE_M_S2 = 0.2, 4.0
"""What a new pose must improve; what a square radian of change costs."""
AT_OBJECT_M = 0.02
"""A hand with no capsule this near is not at the object."""
_STEPS = 3
_STOPPED_M, _CAME_M = 0.004, 0.002
"""An object that moves less than the first from now on, and more than the second until now, is being put down."""
_columns = stack_array(MOST_HANDS * MAX_CAPSULES * EDGES, SIZE)
_wanted, _contact, _numbers = stack_array(SIZE), stack_array(CONTACT), stack_array(MOST_HANDS)
_contacts = stack_array(MOST_HANDS, MAX_CAPSULES, CONTACT)
_turns, _shifts = stack_array(MOST_HANDS, 3, 3), stack_array(MOST_HANDS, 3)
_positions, _rotations, _axes = stack_array(MAX_JOINTS, 3), stack_array(MAX_JOINTS, 3, 3), stack_array(MAX_ANGLES, 3)
_angles, _costs, _poses = stack_array(MAX_ANGLES), stack_array(MOST_POSES), stack_array(MOST_POSES, CHAIN_LENGTH)


class Hands(NamedTuple):
    """The hands `first … last - 1` about one shape, as they were posed at this tick."""

    skeleton: Skeleton
    chains: Chains
    limits: Array
    """`(A, 2)` radians."""
    solid: Solid
    windows: Windows
    first: int
    last: int
    predicted: Array
    """`(N, A)` angles of the network."""
    angles: Array
    """`(N, A)` angles with contacts corrected."""
    distances: Array
    """`(N, J)` from the joints to the surface as predicted, metres."""
    grips: Array
    """`(N, G)`, which are changed."""


class Work(NamedTuple):
    """Working memory for the hands that hold one object."""

    numbers: Array
    """`(H,)` which hands they are."""
    contacts: Array
    """`(H, C, 7)` of their capsules."""
    turns: Array
    """`(H, 3, 3)` and `shifts (H, 3)`: from their wrists to the object."""
    shifts: Array
    columns: Array
    """`(N, 6)` forces and torques that they can supply."""
    directions: Array
    """`(3, 3)` upward and two sideways directions in the object's axes."""
    wanted: Array
    angles: Array
    """A hand's `(A,)` angles, `(J, 3)` joints, `(B, 3, 3)` bones and `(A, 3)` hinges."""
    positions: Array
    rotations: Array
    axes: Array


@inner
def improve_grips(hands: Hands):
    """Update the memory of every hand, and improve the grip on every object that its hands do not carry."""
    work = Work(
        _numbers(),
        _contacts(),
        _turns(),
        _shifts(),
        _columns(),
        matrix(),
        _wanted(),
        _angles(),
        _positions(),
        _rotations(),
        _axes(),
    )
    for n in range(hands.first, hands.last):
        _remember(hands, n)
    for n in range(hands.first, hands.last):
        again = False
        for m in range(hands.first, n):
            again = again or _same_object(hands.windows, n, m)
        if not again:
            _look_after(hands, n, work)


@inner
def leave_grips(hands: Hands):
    """Solvers without grips remember nothing."""


@inner
def _same_object(windows: Windows, n: int, m: int):
    """Whether two hands have the same object: it is at the same place, mirrored for a left hand."""
    for i in range(7):
        if abs(abs(windows.object[n, PRESENT, i]) - abs(windows.object[m, PRESENT, i])) > 1e-9:
            return False
    flip = 1.0 if windows.mirrored[n] == windows.mirrored[m] else -1.0
    return abs(windows.object[n, PRESENT, 0] - flip * windows.object[m, PRESENT, 0]) < 1e-9


@inner
def _remember(hands: Hands, n: int):
    """Whether hand `n` holds its object, with hysteresis, and where its fingers are on their way."""
    chains, windows, distances = hands.chains, hands.windows, hands.distances[n]
    fingers, nearest = len(chains.angles), np.inf
    grip = unpack_grip(hands.grips[n], fingers)
    confidence = grasp_confidence(windows.wrist[n], windows.object[n], windows.other_wrist[n])
    for finger in range(fingers):
        nearest = min(nearest, finger_clearance(chains, finger, distances))
    if confidence > TAKES:
        grip.hand[HELD_TICKS] += 1.0
    elif confidence < LEAVES and nearest > LEAVES_M:
        grip.hand[HELD_TICKS] = 0.0
    held = grip.hand[HELD_TICKS] > 0.0
    for finger in range(fingers):
        if not held:
            loosen_anchor(grip.anchors, finger, False)
        if not held or (confidence < TAKES and finger_clearance(chains, finger, distances) > LEAVES_M):
            grip.ages[finger] = 0.0
        move_finger(chains, finger, hands.predicted[n], grip)


@inner
def _set_directions(windows: Windows, n: int, out: Array):
    """The world's y, x and z axes in the axes of the object of hand `n`, into `out (3, 3)`."""
    turn = matrix()
    quat_to_matrix_into(windows.object[n, PRESENT, 3:], turn)
    for i in range(3):
        flip = -1.0 if windows.mirrored[n] and i == 0 else 1.0
        out[0, i], out[1, i], out[2, i] = flip * turn[1, i], flip * turn[0, i], flip * turn[2, i]


@inner
def _left(work: Work, count: int, x: float, z: float):
    """What the first `count` columns leave of the weight when it is pushed aside by `x` and `z` of it, m/s²."""
    for i in range(3):
        up, across, along = work.directions[0, i], work.directions[1, i], work.directions[2, i]
        work.wanted[i], work.wanted[3 + i] = GRAVITY_M_S2 * (up + x * across + z * along), 0.0
    return unexplained(work.columns, count, work.wanted, 0.5 * ENOUGH_M_S2)


@inner
def _left_at_worst(work: Work, count: int):
    """What the columns leave at worst, and what they leave of the weight alone, m/s²."""
    plain = _left(work, count, 0.0, 0.0)
    worst = plain
    if plain <= ENOUGH_M_S2:
        for side in range(4):
            push = PUSHED_ASIDE if side % 2 == 0 else -PUSHED_ASIDE
            worst = max(worst, _left(work, count, push if side < 2 else 0.0, push if side >= 2 else 0.0))
    return worst, plain


@inner
def _find_holders(hands: Hands, first: int, work: Work):
    """The hands that hold the object of hand `first`, into `work.numbers`; returns how many."""
    count = 0
    for n in range(first, hands.last):
        holds = hands.grips[n, HELD_TICKS] >= TAKEN_TICKS
        if holds and count < MOST_HANDS and (n == first or _same_object(hands.windows, first, n)):
            work.numbers[count] = n
            count += 1
    return count


@inner
def _find_contacts(hands: Hands, h: int, work: Work):
    """The contacts of holder `h`; a finger that is on its way to a pose touches as it will there."""
    chains, windows, n = hands.chains, hands.windows, int(work.numbers[h])
    grip = unpack_grip(hands.grips[n], len(chains.angles))
    for a in range(len(hands.limits)):
        work.angles[a] = hands.angles[n, a]
    for finger in range(len(chains.angles)):
        for k in range(CHAIN_LENGTH):
            a = chains.angles[finger, k]
            if a >= 0 and 0.0 < grip.ages[finger] < ARRIVING_TICKS:
                work.angles[a] = grip.poses[a]
    forward_kinematics_into(hands.skeleton, work.angles, work.positions, work.rotations, work.axes)
    wrist, obj = windows.wrist[n, PRESENT], windows.object[n, PRESENT]
    object_from_wrist(wrist, obj, windows.mirrored[n], work.turns[h], work.shifts[h])
    surface = _surface(hands, h, work)
    for c in range(len(chains.radii)):
        find_contact(chains, c, work.positions, surface, hands.solid, work.contacts[h, c])
    for finger in range(len(chains.angles)):
        tip, capsule = last_of(chains.joints[finger]), last_of(chains.capsules[finger])
        if tip >= 0 and capsule >= 0:
            move_anchor(work.positions[tip], work.contacts[h, capsule, 0], surface, grip.anchors, finger)


@inner
def _surface(hands: Hands, h: int, work: Work):
    return Surface(hands.solid.field, work.turns[h], work.shifts[h], hands.windows.scale[int(work.numbers[h])])


@inner
def _add_hand(hands: Hands, h: int, but_finger: int, work: Work, count: int):
    """Append what the capsules of holder `h` supply, without those of one finger if it is not -1."""
    for c in range(len(hands.chains.radii)):
        touches = work.contacts[h, c, 0] < TOUCH_M
        if touches and but_finger >= 0:
            for k in range(CHAIN_LENGTH):
                touches = touches and hands.chains.capsules[but_finger, k] != c
        if touches:
            scale = hands.windows.scale[int(work.numbers[h])]
            count = add_wrenches(work.contacts[h, c], hands.solid.center_of_mass, scale, work.columns, count)
    return count


@inner
def _moved(obj: Array, start: int, stop: int):
    """How far an object moves between two samples of its window `(21, 7)`, metres, turning included."""
    far = near = turned = 0.0
    for i in range(7):
        apart = (obj[stop, i] - obj[start, i]) ** 2
        if i < 3:
            far += apart
        else:
            near += apart
            turned += (obj[stop, i] + obj[start, i]) ** 2
    return np.sqrt(far) + 2.0 * ARM_M * np.sqrt(min(near, turned))


@inner
def _look_after(hands: Hands, first: int, work: Work):
    """Improve the grip on the object of hand `first` by one finger, if its holders do not carry it."""
    holders = _find_holders(hands, first, work)
    if holders == 0:
        return
    count = 0
    for h in range(holders):
        _find_contacts(hands, h, work)
        count = _add_hand(hands, h, -1, work, count)
    _set_directions(hands.windows, first, work.directions)
    worst, plain = _left_at_worst(work, count)
    leader = hands.grips[int(work.numbers[0])]
    if worst <= ENOUGH_M_S2:
        leader[FAILED_TICKS] = 0.0
        return
    leader[FAILED_TICKS] += 1.0 if plain <= ENOUGH_M_S2 else PATIENCE_TICKS
    obj = hands.windows.object[first]
    put_down = _moved(obj, PRESENT, PRESENT + _STEPS) < _STOPPED_M and _moved(obj, PRESENT - _STEPS, PRESENT) > _CAME_M
    if put_down or leader[FAILED_TICKS] < PATIENCE_TICKS:
        return
    # the fingers in turn, each first near its present pose; in the next round each over its whole range
    fingers = len(hands.chains.angles)
    rounds = holders * fingers
    for _ in range(rounds):
        turn = int(leader[NEXT_FINGER])
        leader[NEXT_FINGER] = (turn + 1) % (2 * rounds)
        h, finger = turn % holders, turn // holders % fingers
        if _may_help(hands, h, finger, work):
            _improve_finger(hands, h, finger, holders, turn >= rounds, worst, work)
            return


@inner
def _may_help(hands: Hands, h: int, finger: int, work: Work):
    """Whether a finger is not on its way already, and its hand is at the object."""
    grip = unpack_grip(hands.grips[int(work.numbers[h])], len(hands.chains.angles))
    if 0.0 < grip.ages[finger] < ARRIVING_TICKS:
        return False
    nearest = np.inf
    for c in range(len(hands.chains.radii)):
        nearest = min(nearest, work.contacts[h, c, 0])
    return nearest < AT_OBJECT_M


@inner
def _improve_finger(hands: Hands, h: int, finger: int, holders: int, wide: bool, worst: float, work: Work):
    """Give a finger of holder `h` the pose that helps most, if one helps."""
    n, chains, best, chosen = int(work.numbers[h]), hands.chains, worst - BETTER_M_S2, -1
    grip, costs, poses, contact = unpack_grip(hands.grips[n], len(chains.angles)), _costs(), _poses(), _contact()
    others = 0
    for other in range(holders):
        others = _add_hand(hands, other, finger if other == h else -1, work, others)
    for a in range(len(hands.limits)):
        work.angles[a] = hands.angles[n, a]
    forward_kinematics_into(hands.skeleton, work.angles, work.positions, work.rotations, work.axes)
    surface, reference = _surface(hands, h, work), hands.predicted[n]
    posed = work.angles, work.positions, work.rotations, work.axes
    found = touching_poses(hands.skeleton, chains, hands.limits, surface, finger, wide, reference, *posed, costs, poses)
    for row in range(found):
        for k in range(CHAIN_LENGTH):
            a = chains.angles[finger, k]
            if a >= 0:
                work.angles[a] = poses[row, k]
        pose_finger_into(hands.skeleton, chains, finger, *posed)
        count = others
        for k in range(CHAIN_LENGTH):
            c = chains.capsules[finger, k]
            if c >= 0:
                find_contact(chains, c, work.positions, surface, hands.solid, contact)
                if contact[0] < TOUCH_M:
                    count = add_wrenches(contact, hands.solid.center_of_mass, surface.scale, work.columns, count)
        score = _left_at_worst(work, count)[0] + POSTURE_M_S2 * max(costs[row], 0.0)
        if score < best:
            best, chosen = score, row
    if chosen >= 0:
        take_pose(chains, finger, poses[chosen], grip)
