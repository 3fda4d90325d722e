"""Whether numbers may leave the server: all of them finite, and quaternions of unit length."""

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import kernel


@kernel
def are_sound(numbers: Array, quaternions: np.ndarray, most: float, tolerance: float):
    """Whether all `numbers (n,)` are finite and at most as large as `most`, and all quaternions of unit length.

    The places of the quaternions are `quaternions (m, 4)`; their squared lengths may differ from 1 by the `tolerance`.
    """
    for i in range(len(numbers)):
        if not abs(numbers[i]) <= most:
            return False
    for i in range(len(quaternions)):
        square = 0.0
        for k in range(4):
            square += numbers[quaternions[i, k]] ** 2
        if not abs(square - 1.0) <= tolerance:
            return False
    return True
