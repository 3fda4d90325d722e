"""Where things are, as the kernels see them: one hand's window in its own wrist frame, as if it were a right hand."""

from manipnet.jit import inner, matrix

SENSOR_RANGE_M = 0.10
"""Where proximity and signed distances saturate (paper, section 5.2)."""


@inner
def quat_to_matrix_into(q, out):
    """Rotation matrix of the unit quaternion `q (4,)` xyzw, into `out (3, 3)`."""
    x, y, z, w = q[0], q[1], q[2], q[3]
    out[0, 0], out[0, 1], out[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
    out[1, 0], out[1, 1], out[1, 2] = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
    out[2, 0], out[2, 1], out[2, 2] = 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)


@inner
def object_from_wrist(wrist, obj, mirrored, rotation, translation):
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
def map_point(rotation, translation, scale, x, y, z):
    """A point in wrist coordinates to the object's own coordinates."""
    size = 1.0 / scale  # the same for many points: one division for all of them
    return (
        (rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z + translation[0]) * size,
        (rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z + translation[1]) * size,
        (rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z + translation[2]) * size,
    )


@inner
def map_direction_back(rotation, x, y, z):
    """A direction in the object's coordinates to wrist coordinates."""
    return (
        rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z,
        rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z,
        rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z,
    )
