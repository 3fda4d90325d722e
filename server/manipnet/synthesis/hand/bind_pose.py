"""The pose in which the hand's skin was made: relaxed, fingers a little bent and spread."""

from typing import Final

import numpy as np

BIND_ANGLES_RAD: Final = np.radians(
    [0, 0, 5, 10, 15, 8, 25, 15, 15, 0, 25, 15, 15, -8, 25, 15, 15, -18, 25, 15]  # as skeleton.DOF_NAMES
).astype(np.float64)
