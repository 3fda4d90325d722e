"""The map between a hand's wrist frame and an object's own frame, as kernels see the scene: every hand a right one."""

from manipnet.geometry import Array
from manipnet.jit import inner, matrix
from manipnet.synthesis.rotations import quat_to_matrix_into

SENSOR_RANGE_M = 0.10
"""Distance at which the proximity and signed distance sensors saturate (paper, section 5.2)."""


@inner
def object_from_wrist(wrist: Array, obj: Array, mirrored: bool, rotation: Array, translation: Array):
    """From wrist coordinates to the object's own metres: `x_object = (rotation · x_wrist + translation) / scale`.

    `wrist` and `obj` are poses `(7,)` of the scene as the network sees it; in a mirrored scene the object is its mirror
    image, so the map ends with a reflection. `rotation (3, 3)` and `translation (3,)` are written.
    """
    w, o = matrix(), matrix()
    quat_to_matrix_into(wrist[3:], w)
    quat_to_matrix_into(obj[3:], o)
    for i in range(3):
        flip = -1.0 if mirrored and i == 0 else 1.0
        translation[i] = 0.0
        for k in range(3):
            translation[i] += flip * o[k, i] * (wrist[k] - obj[k])
        for j in range(3):
            rotation[i, j] = flip * (o[0, i] * w[0, j] + o[1, i] * w[1, j] + o[2, i] * w[2, j])


@inner
def map_point(rotation: Array, translation: Array, scale: float, x: float, y: float, z: float):
    """A point in wrist coordinates to the object's own coordinates."""
    size = 1.0 / scale  # the same for many points: one division for all of them
    return (
        (rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z + translation[0]) * size,
        (rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z + translation[1]) * size,
        (rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z + translation[2]) * size,
    )


@inner
def map_direction_back(rotation: Array, x: float, y: float, z: float):
    """A direction in the object's coordinates to wrist coordinates."""
    return (
        rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z,
        rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z,
        rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z,
    )
