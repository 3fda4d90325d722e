"""Converts poses to the axes of other programs.

Each conversion is one signed permutation of the project frame, which is right-handed, Y up, in metres.
"""

import numpy as np

from manipnet.geometry import Array


def to_unity(poses: Array) -> Array:
    """Convert poses `(..., 7)` to left-handed, Y up, metres: x is reversed."""
    return poses * np.array([-1.0, 1.0, 1.0, 1.0, -1.0, -1.0, 1.0])


def to_unreal(poses: Array) -> Array:
    """Convert poses `(..., 7)` to left-handed, Z up, centimetres.

    The position (x, y, z) becomes (z, -x, y), as in OptiTrack's Live Link plugin, so that its bodies and our hands
    share one level.
    """
    x, y, z, qx, qy, qz, qw = np.moveaxis(poses, -1, 0)
    return np.stack([100.0 * z, -100.0 * x, 100.0 * y, -qz, qx, -qy, qw], axis=-1)


def to_blender(poses: Array) -> Array:
    """Convert poses `(..., 7)` to right-handed, Z up, metres. The quaternion stays xyzw."""
    x, y, z, qx, qy, qz, qw = np.moveaxis(poses, -1, 0)
    return np.stack([x, -z, y, qx, -qz, qy, qw], axis=-1)
