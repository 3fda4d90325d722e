"""Whether a hand holds the object, and with which fingers: what the network's distances alone do not settle.

An object that moves, and moves with the wrist, is held: on the published takes the captured hand touches it in 99.5 %
of such frames. Then the thumb and whichever fingers are nearest belong on its surface.
"""

import numpy as np

from manipnet.jit import inner, matrix, stack_array, vector
from manipnet.synthesis.ik.chains import CAPSULE_ENDS, CAPSULE_RADII, CAPSULE_STARTS, CAPSULES, FINGERS
from manipnet.synthesis.model.layout import PRESENT
from manipnet.synthesis.sensing.scene import quat_to_matrix_into

ARM_M = 0.05
"""Points this far from the object's origin are watched, so that turning counts as motion too."""
FIRST, LAST = 5, 16
"""Samples of the window that are looked at: a quarter of a second to either side."""
STILL_M, MOVING_M = 0.004, 0.010
"""Motion of the object that does not count, and that counts in full."""
TOGETHER, APART = 0.6, 1.0
"""Its motion as the wrist sees it, over its motion: surely held, surely not."""
HELPS_M, ALONE_M = 0.15, 0.25
"""How far the other wrist is from the object where it may hold it, and where it surely does not."""
TAKES_PART_M = 0.010
"""A finger predicted to be this much farther from the object than the nearest one is left out of the grip."""
_POINTS = 4
_points = stack_array(_POINTS, 3)


@inner
def grasp_confidence(wrist, obj, other):
    """How sure it is, 0 to 1, that the hand with poses `wrist (21, 7)` holds the object with poses `obj (21, 7)`.

    What moves without it is in the `other (21, 3)` wrist's hand, or, where that one is far, in its fingers.
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
def grip_into(distances, hold, grip):
    """How much each finger takes part in a hold, `grip (5,)`: the thumb, and the fingers that predicted joint
    `distances (22,)` bring nearest."""
    nearest = np.inf
    for finger in range(1, FINGERS):
        grip[finger] = np.inf
        for c in CAPSULES[finger]:
            clearance = min(distances[CAPSULE_STARTS[c]], distances[CAPSULE_ENDS[c]]) - CAPSULE_RADII[c]
            grip[finger] = min(grip[finger], max(clearance, 0.0))
        nearest = min(nearest, grip[finger])
    grip[0] = hold
    for finger in range(1, FINGERS):
        grip[finger] = hold * min(max(1.0 - (grip[finger] - nearest) / TAKES_PART_M, 0.0), 1.0)
