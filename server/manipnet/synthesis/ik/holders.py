"""The hands that hold one object, and how much of its weight their contacts can carry."""

from typing import NamedTuple

from manipnet.geometry import Array
from manipnet.jit import inner, matrix
from manipnet.synthesis.hand.hand import CHAIN_LENGTH, Chains, Skeleton
from manipnet.synthesis.hand.kinematics import forward_kinematics_into
from manipnet.synthesis.ik.chains import Surface
from manipnet.synthesis.ik.contacts import TOUCH_M, add_wrenches, find_contact
from manipnet.synthesis.ik.grip import ARRIVING_TICKS, HELD_TICKS, Grip, last_of, move_anchor, unpack_grip
from manipnet.synthesis.ik.nnls import unexplained
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
SPARE_M_S2 = 0.5 * ENOUGH_M_S2
"""If no more than this is left, the contacts carry with some to spare."""
TAKEN_TICKS = 14
"""The confidence looks a quarter of a second ahead, so a hand that takes an object has these ticks to close."""


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
def same_object(windows: Windows, n: int, m: int):
    """Whether two hands have the same object: it is at the same place, mirrored for a left hand."""
    for i in range(7):
        if abs(abs(windows.object[n, PRESENT, i]) - abs(windows.object[m, PRESENT, i])) > 1e-9:
            return False
    flip = 1.0 if windows.mirrored[n] == windows.mirrored[m] else -1.0
    return abs(windows.object[n, PRESENT, 0] - flip * windows.object[m, PRESENT, 0]) < 1e-9


@inner
def find_holders(hands: Hands, first: int, work: Work):
    """The hands that hold the object of hand `first`, into `work.numbers`; returns how many."""
    count = 0
    for n in range(first, hands.last):
        holds = hands.grips[n, HELD_TICKS] >= TAKEN_TICKS
        if holds and count < MOST_HANDS and (n == first or same_object(hands.windows, first, n)):
            work.numbers[count] = n
            count += 1
    return count


@inner
def pose_arrived(hands: Hands, n: int, grip: Grip, work: Work):
    """Pose hand `n` in `work` as it will be when the fingers that are on the way to a pose have arrived."""
    chains = hands.chains
    for a in range(len(hands.limits)):
        work.angles[a] = hands.angles[n, a]
    for finger in range(len(chains.angles)):
        for k in range(CHAIN_LENGTH):
            a = chains.angles[finger, k]
            if a >= 0 and 0.0 < grip.ages[finger] < ARRIVING_TICKS:
                work.angles[a] = grip.poses[a]
    forward_kinematics_into(hands.skeleton, work.angles, work.positions, work.rotations, work.axes)


@inner
def find_contacts(hands: Hands, h: int, work: Work):
    """The contacts of holder `h`; a finger that is on the way to a pose touches as it will there."""
    chains, windows, n = hands.chains, hands.windows, int(work.numbers[h])
    grip = unpack_grip(hands.grips[n], len(chains.angles))
    pose_arrived(hands, n, grip, work)
    wrist, obj = windows.wrist[n, PRESENT], windows.object[n, PRESENT]
    object_from_wrist(wrist, obj, windows.mirrored[n], work.turns[h], work.shifts[h])
    surface = surface_of(hands, h, work)
    for c in range(len(chains.radii)):
        find_contact(chains, c, work.positions, surface, hands.solid, work.contacts[h, c])
    for finger in range(len(chains.angles)):
        tip, capsule = last_of(chains.joints[finger]), last_of(chains.capsules[finger])
        if tip >= 0 and capsule >= 0:
            move_anchor(work.positions[tip], work.contacts[h, capsule, 0], surface, grip.anchors, finger)


@inner
def surface_of(hands: Hands, h: int, work: Work):
    return Surface(hands.solid.field, work.turns[h], work.shifts[h], hands.windows.scale[int(work.numbers[h])])


@inner
def add_hand(hands: Hands, h: int, but_finger: int, work: Work, count: int):
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
def set_directions(windows: Windows, n: int, out: Array):
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
    return unexplained(work.columns, count, work.wanted, SPARE_M_S2)


@inner
def left_at_worst(work: Work, count: int):
    """What the columns leave at worst, and what they leave of the weight alone, m/s²."""
    plain = _left(work, count, 0.0, 0.0)
    worst = plain
    if plain <= ENOUGH_M_S2:
        for side in range(4):
            push = PUSHED_ASIDE if side % 2 == 0 else -PUSHED_ASIDE
            worst = max(worst, _left(work, count, push if side < 2 else 0.0, push if side >= 2 else 0.0))
    return worst, plain
