"""Compiled algebra of rotations, as matrices `(3, 3)` and unit quaternions `(4,)` xyzw.

Functions ending in `_into` write their result into the last argument. `manipnet.geometry` has the same for whole arrays
in Python.
"""

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner


@inner
def set_identity(out: Array):
    """The identity matrix, into `out (3, 3)`."""
    for i in range(3):
        for j in range(3):
            out[i, j] = 1.0 if i == j else 0.0


@inner
def copy_matrix_into(a: Array, out: Array):
    """A matrix, into `out (3, 3)`."""
    # a slice assignment would take seconds to compile, for NumPy's broadcasting and its error texts
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, j]


@inner
def multiply_matrices_into(a: Array, b: Array, out: Array):
    """The product `a · b`, into `out (3, 3)`, which is neither of them."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@inner
def axis_rotation_into(axis: Array, angle, out: Array):
    """Rodrigues' formula: the matrix that turns by `angle` about the unit `axis (3,)`, into `out (3, 3)`."""
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = axis[0], axis[1], axis[2]
    k = 1.0 - c
    out[0, 0], out[0, 1], out[0, 2] = c + x * x * k, x * y * k - z * s, x * z * k + y * s
    out[1, 0], out[1, 1], out[1, 2] = y * x * k + z * s, c + y * y * k, y * z * k - x * s
    out[2, 0], out[2, 1], out[2, 2] = z * x * k - y * s, z * y * k + x * s, c + z * z * k


@inner
def quat_to_matrix_into(q: Array, out: Array):
    """The rotation matrix of the unit quaternion `q (4,)`, into `out (3, 3)`."""
    x, y, z, w = q[0], q[1], q[2], q[3]
    out[0, 0], out[0, 1], out[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
    out[1, 0], out[1, 1], out[1, 2] = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
    out[2, 0], out[2, 1], out[2, 2] = 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)


@inner
def matrix_to_quat_into(m: Array, mirrored: bool, out: Array):
    """The unit quaternion with w >= 0 of the rotation matrix `m (3, 3)` or of its mirror image, into `out (4,)`.

    It starts from the largest of the four squared components, so it is stable at every angle (Shepperd 1978).
    """
    squares = (1 + m[0, 0] - m[1, 1] - m[2, 2], 1 - m[0, 0] + m[1, 1] - m[2, 2], 1 - m[0, 0] - m[1, 1] + m[2, 2])
    w = 1 + m[0, 0] + m[1, 1] + m[2, 2]
    if w >= squares[0] and w >= squares[1] and w >= squares[2]:
        out[0], out[1], out[2], out[3] = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], w
    elif squares[0] >= squares[1] and squares[0] >= squares[2]:
        out[0], out[1], out[2], out[3] = squares[0], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[2, 1] - m[1, 2]
    elif squares[1] >= squares[2]:
        out[0], out[1], out[2], out[3] = m[0, 1] + m[1, 0], squares[1], m[1, 2] + m[2, 1], m[0, 2] - m[2, 0]
    else:
        out[0], out[1], out[2], out[3] = m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], squares[2], m[1, 0] - m[0, 1]
    length = np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2 + out[3] ** 2)
    gain = -1.0 / length if out[3] < 0.0 else 1.0 / length
    out[0] *= gain
    out[1] *= -gain if mirrored else gain
    out[2] *= -gain if mirrored else gain
    out[3] *= gain


@inner
def quat_rotate_into(q: Array, v: Array, out: Array):
    """The vector `v (3,)` turned by the unit quaternion `q (4,)`, into `out (3,)`."""
    tx, ty, tz = 2 * (q[1] * v[2] - q[2] * v[1]), 2 * (q[2] * v[0] - q[0] * v[2]), 2 * (q[0] * v[1] - q[1] * v[0])
    out[0] = v[0] + q[3] * tx + q[1] * tz - q[2] * ty
    out[1] = v[1] + q[3] * ty + q[2] * tx - q[0] * tz
    out[2] = v[2] + q[3] * tz + q[0] * ty - q[1] * tx


@inner
def multiply_quats_into(a: Array, sign: float, b: Array, out: Array):
    """The product `a · b`, into `out (4,)`; the vector part of `a` is multiplied by `sign`, so that -1 inverts it."""
    ax, ay, az, aw = sign * a[0], sign * a[1], sign * a[2], a[3]
    x, y = aw * b[0] + ax * b[3] + ay * b[2] - az * b[1], aw * b[1] - ax * b[2] + ay * b[3] + az * b[0]
    z, w = aw * b[2] + ax * b[1] - ay * b[0] + az * b[3], aw * b[3] - ax * b[0] - ay * b[1] - az * b[2]
    out[0], out[1], out[2], out[3] = x, y, z, w


@inner
def rotation_vector_into(m: Array, out: Array):
    """The rotation vector of the matrix `m (3, 3)`, into `out (3,)`; exact for turns well below half a circle."""
    x, y, z = 0.5 * (m[2, 1] - m[1, 2]), 0.5 * (m[0, 2] - m[2, 0]), 0.5 * (m[1, 0] - m[0, 1])
    sine = np.sqrt(x * x + y * y + z * z)
    angle = np.arctan2(sine, 0.5 * (m[0, 0] + m[1, 1] + m[2, 2] - 1.0))
    factor = 1.0 if sine < 1e-9 else angle / sine
    out[0], out[1], out[2] = factor * x, factor * y, factor * z


@inner
def slerp_into(a: Array, b: Array, fraction, out: Array):
    """Between unit quaternions of one hemisphere, a `fraction` of the way along the arc, into `out (4,)`."""
    cosine = min(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3], 1.0)
    angle = np.arccos(cosine)
    sine = np.sin(angle)
    from_a, from_b = 1.0 - fraction, fraction
    if sine > 1e-6:
        from_a, from_b = np.sin((1.0 - fraction) * angle) / sine, np.sin(fraction * angle) / sine
    length = 0.0
    for k in range(4):
        out[k] = from_a * a[k] + from_b * b[k]
        length += out[k] * out[k]
    for k in range(4):
        out[k] /= np.sqrt(length)


@inner
def rotation_vector_between_into(start: Array, end: Array, out: Array):
    """The shortest rotation vector from the unit quaternion `start` to `end`, into `out (3,)`."""
    w = end[0] * start[0] + end[1] * start[1] + end[2] * start[2] + end[3] * start[3]
    x = end[0] * start[3] - end[3] * start[0] - end[1] * start[2] + end[2] * start[1]
    y = end[1] * start[3] - end[3] * start[1] - end[2] * start[0] + end[0] * start[2]
    z = end[2] * start[3] - end[3] * start[2] - end[0] * start[1] + end[1] * start[0]
    sine = np.sqrt(x * x + y * y + z * z)
    angle = 2.0 * np.arctan2(sine, abs(w))
    gain = (2.0 if sine < 1e-9 else angle / sine) * (-1.0 if w < 0.0 else 1.0)
    out[0], out[1], out[2] = gain * x, gain * y, gain * z


@inner
def turn_quat_into(turn: Array, q: Array, out: Array):
    """The unit quaternion `q (4,)` turned further by the rotation vector `turn (3,)`, into `out (4,)`."""
    angle = np.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    gain = 0.5 if angle < 1e-9 else np.sin(0.5 * angle) / angle
    x, y, z, w = gain * turn[0], gain * turn[1], gain * turn[2], np.cos(0.5 * angle)
    out[0] = w * q[0] + x * q[3] + y * q[2] - z * q[1]
    out[1] = w * q[1] - x * q[2] + y * q[3] + z * q[0]
    out[2] = w * q[2] + x * q[1] - y * q[0] + z * q[3]
    out[3] = w * q[3] - x * q[0] - y * q[1] - z * q[2]
