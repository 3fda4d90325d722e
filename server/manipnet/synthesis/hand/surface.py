"""The hand's own skin: a closed mesh with bone weights, and the 104 proximity sensors of its palm side.

The data is made by `manipnet_tools.assets.hand_surface` from the skeleton; the sensors are part of what a model is
trained on, so changing them makes every bundle unusable.
"""

from functools import cache
from importlib.resources import as_file, files
from typing import Final

import numpy as np

from manipnet.geometry import Array
from manipnet.synthesis.hand.bind_pose import BIND_ANGLES_RAD
from manipnet.synthesis.hand.kinematics import forward_kinematics

with as_file(files("manipnet.synthesis.hand") / "surface.npz") as _path, open(_path, "rb") as _file:
    _data = dict(np.load(_file, allow_pickle=False))

VERTICES: Final = _data["vertices"].astype(np.float64)
"""`(V, 3)` in the wrist frame of a right hand in the bind pose, metres."""
FACES: Final = _data["faces"].astype(np.int32)
"""`(F, 3)`, counter-clockwise from outside on a right hand."""
BONES: Final = _data["bones"].astype(np.int64)
WEIGHTS: Final = _data["weights"].astype(np.float64)
"""The bones each vertex follows and how much, `(V, 4)`; weights sum to one."""

SENSOR_BONES: Final = _data["sensor_bones"].astype(np.int64)
SENSOR_WEIGHTS: Final = _data["sensor_weights"]
"""The bones each sensor follows and how much, `(104, 2)`."""
SENSOR_POINTS: Final = _data["sensor_points"]
SENSOR_NORMALS: Final = _data["sensor_normals"]
"""Position and outward normal of each sensor in the frame of each of its bones, `(104, 2, 3)`."""


@cache
def _vertices_in_bones() -> Array:
    """Every vertex in the frame of each bone it follows, `(V, 4, 3)`."""
    positions, rotations = forward_kinematics(BIND_ANGLES_RAD)
    return np.einsum("vkji,vkj->vki", rotations[BONES], VERTICES[:, None] - positions[BONES])


def skin(positions: Array, rotations: Array) -> Array:
    """Linear blend skinning: vertices `(..., V, 3)` of a hand with joints `positions (..., 22, 3)` and bone `rotations
    (..., 17, 3, 3)`, in whatever frame those are in (a left hand mirrored as a whole afterwards)."""
    turned = np.einsum("...vkij,vkj->...vki", rotations[..., BONES, :, :], _vertices_in_bones())
    return np.sum(WEIGHTS[..., None] * (turned + positions[..., BONES, :]), axis=-2)
