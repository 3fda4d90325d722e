"""From the project's axes (right-handed, Y up) to Blender's (right-handed, Z up), metres both. Quaternions are xyzw."""

import numpy as np

from .manipnet_client.retarget import multiply

Y_UP_TO_Z_UP = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
"""A quarter turn about x carries our up, +y, to Blender's, +z."""


def to_blender(pose: np.ndarray) -> np.ndarray:
    """A pose `(7,)` in Blender's world, its local axes renamed alike: +y along an OpenXR joint's bone, +z its back."""
    x, y, z, qx, qy, qz, qw = pose
    return np.array([x, -z, y, qx, -qz, qy, qw])


def turned_to_blender(q: np.ndarray) -> np.ndarray:
    """A rotation `(4,)` whose local axes stay what they are, as those of a rig's bone must."""
    return multiply(Y_UP_TO_Z_UP, q)
