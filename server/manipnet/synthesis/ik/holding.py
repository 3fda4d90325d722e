"""Holding: which fingers must touch so that what a hand holds does not fall.

A hand that moves with an object holds it. The contacts of all hands that hold it must be able to carry its weight, also
when it is pushed aside a little. Where they cannot, one finger a tick gets the nearest pose that helps most, first near
its present pose and then over its whole range. While the contacts carry with some to spare, that pose eases toward the
network's; it is given up when the hand lets go. An object that lies where it lay before needs no hand to carry it.
"""

import numpy as np

from manipnet.jit import inner, matrix, stack_array
from manipnet.synthesis.hand.hand import CHAIN_LENGTH, MAX_ANGLES, MAX_CAPSULES, MAX_JOINTS
from manipnet.synthesis.hand.kinematics import pose_finger_into
from manipnet.synthesis.ik.contacts import CONTACT, EDGES, TOUCH_M, add_wrenches, find_contact
from manipnet.synthesis.ik.finger_poses import MOST_POSES, touching_poses
from manipnet.synthesis.ik.grasp import finger_clearance, grasp_confidence
from manipnet.synthesis.ik.grip import (
    ARRIVING_TICKS,
    FAILED_TICKS,
    FAILURES,
    HELD_TICKS,
    NEXT_FINGER,
    ease_fingers,
    loosen_anchor,
    move_finger,
    take_pose,
    unpack_grip,
)
from manipnet.synthesis.ik.holders import (
    ENOUGH_M_S2,
    MOST_HANDS,
    SPARE_M_S2,
    Hands,
    Work,
    add_hand,
    find_contacts,
    find_holders,
    left_at_worst,
    pose_arrived,
    same_object,
    set_directions,
    surface_of,
)
from manipnet.synthesis.ik.nnls import SIZE
from manipnet.synthesis.ik.overlap import finger_overlap
from manipnet.synthesis.ik.support import lies, moved
from manipnet.synthesis.model.layout import PRESENT

TAKES, LEAVES = 0.5, 0.1
"""The confidence in a grasp at which a hand takes the object, and below which it may let go."""
LEAVES_M = 0.012
"""A finger that is predicted to be farther than this from the object lets go."""
PATIENCE_TICKS = 5
"""A grip that carries the weight but not a push may be that short of it for this long."""
EASE, EASES_FREELY = 0.05, 6
"""Share of the way to the network's pose that a finger with a pose of its own goes per tick while nothing needs it; it
is halved with every failure of the hold beyond this number, so that a hold comes to rest."""
BETTER_M_S2, POSTURE_M_S2 = 0.2, 4.0
"""What a new pose must improve; what a square radian of change costs."""
OVERLAP_M, OVERLAP_S2 = 0.006, 60.0
"""Fingers of a person overlap by the first at most; what a metre more costs."""
AT_OBJECT_M = 0.02
"""A hand with no capsule this near is not at the object."""
_STEPS = 3
_STOPPED_M, _CAME_M = 0.004, 0.002
"""An object that moves less than the first from now on, and more than the second until now, is being put down."""
_columns = stack_array(MOST_HANDS * MAX_CAPSULES * EDGES, SIZE)
_wanted, _numbers = stack_array(SIZE), stack_array(MOST_HANDS)
_contacts = stack_array(MOST_HANDS, MAX_CAPSULES, CONTACT)
_turns, _shifts = stack_array(MOST_HANDS, 3, 3), stack_array(MOST_HANDS, 3)
_positions, _rotations, _axes = stack_array(MAX_JOINTS, 3), stack_array(MAX_JOINTS, 3, 3), stack_array(MAX_ANGLES, 3)
_angles = stack_array(MAX_ANGLES)
_contact = stack_array(CONTACT)
_costs, _poses = stack_array(MOST_POSES), stack_array(MOST_POSES, CHAIN_LENGTH)


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
            again = again or same_object(hands.windows, n, m)
        if not again:
            _look_after(hands, n, work)


@inner
def leave_grips(hands: Hands):
    """Solvers without grips remember nothing."""


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
        grip.hand[HELD_TICKS] = grip.hand[FAILURES] = 0.0
    held = grip.hand[HELD_TICKS] > 0.0
    for finger in range(fingers):
        if not held:
            loosen_anchor(grip.anchors, finger, False)
        if not held or (confidence < TAKES and finger_clearance(chains, finger, distances) > LEAVES_M):
            grip.ages[finger] = 0.0
        move_finger(chains, finger, hands.predicted[n], grip)


@inner
def _look_after(hands: Hands, first: int, work: Work):
    """Improve the grip on the object of hand `first` by one finger, if nothing carries it."""
    holders = find_holders(hands, first, work)
    set_directions(hands.windows, first, work.directions)
    lying = lies(hands, first)
    if holders == 0:
        return
    count = 0
    for h in range(holders):
        find_contacts(hands, h, work)
        count = add_hand(hands, h, -1, work, count)
    worst, plain = left_at_worst(work, count)
    leader = hands.grips[int(work.numbers[0])]
    before = leader[FAILED_TICKS]
    if lying or worst <= ENOUGH_M_S2:
        leader[FAILED_TICKS] = 0.0
    else:
        leader[FAILED_TICKS] += 1.0 if plain <= ENOUGH_M_S2 else PATIENCE_TICKS
    failed = leader[FAILED_TICKS] >= PATIENCE_TICKS
    leader[FAILURES] += 1.0 if failed and before < PATIENCE_TICKS else 0.0
    carries_more = lying or worst <= SPARE_M_S2
    eases = EASE * 0.5 ** max(leader[FAILURES] - EASES_FREELY, 0.0) if carries_more else 0.0
    for h in range(holders):
        n = int(work.numbers[h])
        ease_fingers(hands.chains, eases, hands.predicted[n], unpack_grip(hands.grips[n], len(hands.chains.angles)))
    obj = hands.windows.object[first]
    put_down = moved(obj, PRESENT, PRESENT + _STEPS) < _STOPPED_M and moved(obj, PRESENT - _STEPS, PRESENT) > _CAME_M
    if put_down or not failed:
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
        others = add_hand(hands, other, finger if other == h else -1, work, others)
    pose_arrived(hands, n, grip, work)
    surface, reference = surface_of(hands, h, work), hands.predicted[n]
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
        overlap_m = max(finger_overlap(chains, finger, work.positions) - OVERLAP_M, 0.0)
        unlike = POSTURE_M_S2 * max(costs[row], 0.0) + OVERLAP_S2 * overlap_m
        score = left_at_worst(work, count)[0] + unlike
        if score < best:
            best, chosen = score, row
    if chosen >= 0:
        take_pose(chains, finger, poses[chosen], grip)
