"""Conversion from the project's axes (right-handed, Y up) to Blender's (right-handed, Z up). Quaternions are xyzw."""

from collections.abc import Sequence

import mathutils
import numpy as np

from .manipnet_client.retarget import multiply

Y_UP_TO_Z_UP = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
"""A quarter turn about x, which rotates the project's up direction +y to Blender's +z."""


def to_blender(pose: np.ndarray) -> np.ndarray:
    """A pose `(7,)` in Blender's world, with converted local axes: +y along an OpenXR bone, +z out of its back."""
    x, y, z, qx, qy, qz, qw = pose
    return np.array([x, -z, y, qx, -qz, qy, qw])


def turned_to_blender(q: np.ndarray) -> np.ndarray:
    """A rotation `(4,)` in Blender's world whose local axes are unchanged, as those of a rig's bone must be."""
    return multiply(Y_UP_TO_Z_UP, q)


def quaternion(xyzw: np.ndarray | Sequence[float]) -> mathutils.Quaternion:
    """Blender's own quaternion for x, y, z, w."""
    x, y, z, w = xyzw
    return mathutils.Quaternion((w, x, y, z))


def xyzw(rotation: mathutils.Quaternion) -> np.ndarray:
    """The numbers x, y, z, w of Blender's own quaternion."""
    w, x, y, z = rotation
    return np.array([x, y, z, w])
