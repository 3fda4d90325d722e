"""Whether a hand holds the object, and with which fingers: the network's distances alone do not settle it.

An object that moves, and moves with the wrist, is held: on the published takes the captured hand touches it in 99.5 %
of such frames. Then the thumb and whichever fingers are nearest belong on its surface.
"""

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, matrix, stack_array, vector
from manipnet.synthesis.hand.hand import CHAIN_LENGTH, Chains
from manipnet.synthesis.model.layout import PRESENT, WINDOW_STEP_S
from manipnet.synthesis.rotations import quat_to_matrix_into

ARM_M = 0.05
"""Distance of the watched points from the object's origin, so that turning counts as motion too."""
FIRST, LAST = 5, 16
"""Samples of the window that are looked at: a quarter of a second to either side."""
STILL_M, MOVING_M = 0.004, 0.010
"""Motion of the object that does not count, and that counts in full."""
TOGETHER, APART = 0.6, 1.0
"""The object's motion relative to the wrist over its motion in the world: surely held, surely not held."""
HELPS_M, ALONE_M = 0.15, 0.25
"""Distance of the other wrist from the object at which it may hold it, and at which it surely does not."""
TAKES_PART_M = 0.010
"""A finger predicted to be this much farther from the object than the nearest one takes no part in the grasp."""
SLOW_M_S, FAST_M_S = 0.05, 0.12
"""Speeds of the object in the hand at which it surely does not slip, and surely does."""
RESTS_M_S, MOVES_M_S = 0.03, 0.06
"""Speeds of the object in the world at which it surely rests, and surely moves."""
_POINTS = 4
_points = stack_array(_POINTS, 3)


@inner
def grasp_confidence(wrist: Array, obj: Array, other: Array):
    """How certain it is, 0 to 1, that the hand with poses `wrist (21, 7)` holds the object with poses `obj (21, 7)`.

    An object that moves without the wrist is in the hand of the `other (21, 3)` wrist or, where that one is far away,
    in this hand's fingers.
    """
    w, o, apart, first, first_seen = matrix(), matrix(), vector(), _points(), _points()
    moved = seen_moved = 0.0
    for t in range(FIRST, LAST):
        quat_to_matrix_into(wrist[t, 3:], w)
        quat_to_matrix_into(obj[t, 3:], o)
        total = seen_total = 0.0
        for p in range(_POINTS):
            far = seen_far = 0.0
            for i in range(3):
                point = obj[t, i] + (ARM_M * o[i, p] if p < 3 else 0.0)
                apart[i] = point - wrist[t, i]
                if t == FIRST:
                    first[p, i] = point
                far += (point - first[p, i]) ** 2
            for i in range(3):
                seen = w[0, i] * apart[0] + w[1, i] * apart[1] + w[2, i] * apart[2]
                if t == FIRST:
                    first_seen[p, i] = seen
                seen_far += (seen - first_seen[p, i]) ** 2
            total += np.sqrt(far) / _POINTS
            seen_total += np.sqrt(seen_far) / _POINTS
        moved, seen_moved = max(moved, total), max(seen_moved, seen_total)
    moves = min(max((moved - STILL_M) / (MOVING_M - STILL_M), 0.0), 1.0)
    together = min(max((APART - seen_moved / max(moved, 1e-6)) / (APART - TOGETHER), 0.0), 1.0)
    apart_m = 0.0
    for i in range(3):
        apart_m += (other[PRESENT, i] - obj[PRESENT, i]) ** 2
    alone = min(max((np.sqrt(apart_m) - HELPS_M) / (ALONE_M - HELPS_M), 0.0), 1.0)
    return moves * max(together, alone)


@inner
def finger_clearance(chains: Chains, finger: int, distances: Array):
    """How far from the object the nearest capsule of a finger is predicted to be, from the joints' `distances (J,)`."""
    nearest = np.inf
    for k in range(CHAIN_LENGTH):
        c = chains.capsules[finger, k]
        if c >= 0:
            clearance = min(distances[chains.starts[c]], distances[chains.ends[c]]) - chains.radii[c]
            nearest = min(nearest, max(clearance, 0.0))
    return nearest


@inner
def finger_confidences_into(chains: Chains, distances: Array, confidence: float, out: Array):
    """How certain it is that each finger takes part in a grasp that is certain with `confidence`, into `out (F,)`.

    The thumb takes part, and so do the fingers that the predicted joint `distances (J,)` bring nearest.
    """
    fingers, nearest = len(chains.angles), np.inf
    for finger in range(1, fingers):
        out[finger] = finger_clearance(chains, finger, distances)
        nearest = min(nearest, out[finger])
    out[0] = confidence
    for finger in range(1, fingers):
        out[finger] = confidence * min(max(1.0 - (out[finger] - nearest) / TAKES_PART_M, 0.0), 1.0)


@inner
def slip_and_rest(wrist: Array, obj: Array):
    """How certain it is, each 0 to 1, that the object moves in the hand, and that it rests in the world.

    A wrist that passes an object at rest, or moves away from it, does not hold it at this moment. The poses `(21, 7)`
    are looked at 50 ms to either side of the present.
    """
    turn, before = matrix(), vector()
    seen_moved = moved = near = far = 0.0
    for t in (PRESENT - 1, PRESENT + 1):
        quat_to_matrix_into(wrist[t, 3:], turn)
        for i in range(3):
            seen = 0.0
            for j in range(3):
                seen += turn[j, i] * (obj[t, j] - wrist[t, j])
            if t < PRESENT:
                before[i] = seen
            else:
                seen_moved += (seen - before[i]) ** 2
    for i in range(7):
        change = (obj[PRESENT + 1, i] - obj[PRESENT - 1, i]) ** 2
        if i < 3:
            moved += change
        else:
            near += change
            far += (obj[PRESENT + 1, i] + obj[PRESENT - 1, i]) ** 2
    speed = np.sqrt(seen_moved) / (2.0 * WINDOW_STEP_S)
    world = (np.sqrt(moved) + 2.0 * ARM_M * np.sqrt(min(near, far))) / (2.0 * WINDOW_STEP_S)
    slips = min(max((speed - SLOW_M_S) / (FAST_M_S - SLOW_M_S), 0.0), 1.0)
    rests = min(max((MOVES_M_S - world) / (MOVES_M_S - RESTS_M_S), 0.0), 1.0)
    return slips, rests
