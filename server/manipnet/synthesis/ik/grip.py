"""What a hand remembers of its grip, and how that changes from tick to tick.

A finger of a hand that holds an object either follows the network or has a pose of its own, which was chosen because it
carries (`holding`). It goes to that pose, and later back to the network's, like a critically damped spring. While the
contacts carry more than they must, its pose eases toward the network's. A fingertip that touches what the hand holds
has an anchor on the object, so that it does not slide.
"""

from typing import NamedTuple

from manipnet.geometry import Array
from manipnet.jit import inner
from manipnet.synthesis.hand.hand import CHAIN_LENGTH, Chains
from manipnet.synthesis.ik.chains import Surface
from manipnet.synthesis.sensing.scene import map_point

HELD_TICKS, NEXT_FINGER, FAILED_TICKS, FAILURES, EASES, LAY_BEFORE, LAY_AT_M = 0, 1, 2, 3, 4, 5, 6
"""Entries of `Grip.hand`."""
_HAND = 7
ANCHOR = 4
"""Numbers of an anchor."""
ARRIVING_TICKS = 14
"""A finger is on the way to its own pose for this long."""
_PACE = 0.35
"""Natural frequency of the way to a pose, radians per tick: nine tenths of it take 11 ticks."""
_WEIGHT_SHARE = 0.15
_ANCHOR_GAP_M, _ANCHOR_LOST_GAP_M, _ANCHOR_REACH_M = 0.004, 0.008, 0.012
"""A fingertip gets an anchor within the first gap, and loses it beyond the second, or when it is this far from it."""
_ANCHOR_SHARE, _ANCHOR_FOLLOWS = 0.2, 0.05
_ANCHOR_GONE = 0.05


class Grip(NamedTuple):
    """The memory of one hand."""

    hand: Array
    """`(7,)`: for how many ticks it has held the object, which finger is looked at next, for how many ticks the object
    has not been carried, how often that happened in this hold, what share of the way its fingers eased toward the
    network's pose at the last tick, whether the object ever lay without a hand, and how high its lowest point was then,
    metres."""
    ages: Array
    """`(F,)` ticks since a finger was given a pose of its own; 0 for a finger that follows the network."""
    weights: Array
    """`(F,)` how much a finger has its own pose, 0 to 1."""
    poses: Array
    """`(A,)` those poses, radians."""
    offsets: Array
    """`(A,)` what is added to the network's angles at this tick, radians."""
    speeds: Array
    """`(A,)` how the offsets change, radians per tick."""
    anchors: Array
    """`(F, 4)`, flat: how firm the anchor of a fingertip is, 0 to 1, and where it is in the object's own metres."""


def grip_size(fingers: int, angles: int) -> int:
    """How many numbers one hand remembers, `G`."""
    return _HAND + (2 + ANCHOR) * fingers + 3 * angles


@inner
def unpack_grip(numbers: Array, fingers: int):
    """The `numbers (G,)` of one hand as a `Grip`."""
    first = _HAND + 2 * fingers
    angles = (len(numbers) - first - ANCHOR * fingers) // 3
    return Grip(
        numbers[:_HAND],
        numbers[_HAND : _HAND + fingers],
        numbers[_HAND + fingers : first],
        numbers[first : first + angles],
        numbers[first + angles : first + 2 * angles],
        numbers[first + 2 * angles : first + 3 * angles],
        numbers[first + 3 * angles :],
    )


@inner
def take_pose(chains: Chains, finger: int, pose: Array, grip: Grip):
    """Give a finger the pose `(4,)` of its own."""
    grip.ages[finger] = 1.0
    for k in range(CHAIN_LENGTH):
        angle = chains.angles[finger, k]
        if angle >= 0:
            grip.poses[angle] = pose[k]


@inner
def move_finger(chains: Chains, finger: int, predicted: Array, grip: Grip):
    """Move a finger one tick toward its own pose, or back toward the network's, which is `predicted (A,)`."""
    own = grip.ages[finger] > 0.0
    if own:
        grip.ages[finger] += 1.0
    grip.weights[finger] += _WEIGHT_SHARE * ((1.0 if own else 0.0) - grip.weights[finger])
    for k in range(CHAIN_LENGTH):
        angle = chains.angles[finger, k]
        if angle >= 0:
            wanted = grip.poses[angle] - predicted[angle] if own else 0.0
            pull = _PACE * (wanted - grip.offsets[angle]) - 2.0 * grip.speeds[angle]
            grip.speeds[angle] += _PACE * pull
            grip.offsets[angle] += grip.speeds[angle]


@inner
def ease_fingers(chains: Chains, share: float, predicted: Array, grip: Grip):
    """Move the poses of fingers that have arrived a `share` of the way to the network's, `predicted (A,)`.

    When the share becomes zero, a finger stays where it is at that moment.
    """
    stops = share == 0.0 and grip.hand[EASES] > 0.0
    grip.hand[EASES] = share
    for finger in range(len(chains.angles)):
        if grip.ages[finger] <= ARRIVING_TICKS:
            continue
        for k in range(CHAIN_LENGTH):
            angle = chains.angles[finger, k]
            if angle >= 0 and stops:
                grip.poses[angle] = predicted[angle] + grip.offsets[angle]
            elif angle >= 0:
                grip.poses[angle] += share * (predicted[angle] - grip.poses[angle])


@inner
def last_of(row: Array):
    """The last entry of a row of `Chains` that is not -1, or -1."""
    for k in range(CHAIN_LENGTH - 1, -1, -1):
        if row[k] >= 0:
            return row[k]
    return -1


@inner
def move_anchor(tip: Array, gap: float, surface: Surface, anchors: Array, finger: int):
    """Set, keep or loosen the anchor of a fingertip at `tip (3,)` that is `gap` metres from the object."""
    at = ANCHOR * finger
    new = anchors[at] == 0.0
    if new and gap > _ANCHOR_GAP_M:
        return
    place = map_point(surface.rotation, surface.translation, surface.scale, tip[0], tip[1], tip[2])
    far = 0.0
    for i in range(3):
        if new:
            anchors[at + 1 + i] = place[i]
        away = place[i] - anchors[at + 1 + i]
        far += (away * surface.scale) ** 2
        anchors[at + 1 + i] += _ANCHOR_FOLLOWS * away
    loosen_anchor(anchors, finger, gap < _ANCHOR_LOST_GAP_M and far < _ANCHOR_REACH_M**2)


@inner
def loosen_anchor(anchors: Array, finger: int, keep: bool):
    """Make an anchor firmer by one tick, or looser unless it is to be kept."""
    at = ANCHOR * finger
    anchors[at] += _ANCHOR_SHARE * ((1.0 if keep else 0.0) - anchors[at])
    if not keep and anchors[at] < _ANCHOR_GONE:
        anchors[at] = 0.0
