"""Whether something else than hands carries an object: it lies where it lay when nobody held it."""

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, matrix, vector
from manipnet.synthesis.ik.grasp import ARM_M, FIRST, LAST, STILL_M
from manipnet.synthesis.ik.grip import HELD_TICKS, LAY_AT_M, LAY_BEFORE
from manipnet.synthesis.ik.holders import Hands, same_object
from manipnet.synthesis.model.layout import PRESENT
from manipnet.synthesis.objects.bvh import least_along
from manipnet.synthesis.rotations import quat_to_matrix_into

OFF_M = 0.008
"""An object whose lowest point is this far above or below the place where it lay has left it."""


@inner
def moved(obj: Array, start: int, stop: int):
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
def _lowest_m(hands: Hands, n: int, sample: int):
    """Height of the lowest point of the object of hand `n` in the world at a sample of its window."""
    windows, turn, up = hands.windows, matrix(), vector()
    quat_to_matrix_into(windows.object[n, sample, 3:], turn)
    for i in range(3):
        up[i] = -turn[1, i] if windows.mirrored[n] and i == 0 else turn[1, i]
    return windows.object[n, sample, 1] + windows.scale[n] * least_along(hands.solid.bvh, up)


@inner
def lies(hands: Hands, first: int):
    """Whether the object of hand `first` lies, and will lie, where it lay when it was at rest and no hand held it.

    An object that was never seen at rest does not lie anywhere. All hands of the object remember the place.
    """
    held = False
    for n in range(first, hands.last):
        held = held or (hands.grips[n, HELD_TICKS] > 0.0 and same_object(hands.windows, first, n))
    grip = hands.grips[first]
    if held:
        for sample in (PRESENT, LAST):
            if grip[LAY_BEFORE] == 0.0 or abs(_lowest_m(hands, first, sample) - grip[LAY_AT_M]) > OFF_M:
                return False
        return True
    obj = hands.windows.object[first]
    if moved(obj, FIRST, PRESENT) > STILL_M or moved(obj, PRESENT, LAST) > STILL_M:
        return False
    lowest = _lowest_m(hands, first, PRESENT)
    for n in range(first, hands.last):
        if same_object(hands.windows, first, n):
            hands.grips[n, LAY_BEFORE], hands.grips[n, LAY_AT_M] = 1.0, lowest
    return True
