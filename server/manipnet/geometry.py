"""Quaternions (xyzw), rigid poses and the mirror, as free functions over arrays.

Project frame: right-handed, Y up, metres. A *pose* is seven numbers, position xyz then quaternion xyzw, `(..., 7)`.
"""

from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Side = Literal["left", "right"]
SIDES: Final[tuple[Side, Side]] = ("left", "right")

MIRROR = np.diag([-1.0, 1.0, 1.0])
"""Reflection through the plane x = 0, which turns a left hand into a right one."""


def quat_multiply(a: Array, b: Array) -> Array:
    """Hamilton product: the rotation `b` followed by `a`. `(..., 4)` each, xyzw."""
    ax, ay, az, aw = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bx, by, bz, bw = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    product = np.empty(np.broadcast_shapes(a.shape, b.shape))
    product[..., 0] = aw * bx + ax * bw + ay * bz - az * by
    product[..., 1] = aw * by - ax * bz + ay * bw + az * bx
    product[..., 2] = aw * bz + ax * by - ay * bx + az * bw
    product[..., 3] = aw * bw - ax * bx - ay * by - az * bz
    return product


def quat_conjugate(q: Array) -> Array:
    """Inverse of unit quaternions, `(..., 4)`."""
    return q * np.array([-1.0, -1.0, -1.0, 1.0])


def quat_rotate(q: Array, v: Array) -> Array:
    """Rotate vectors `(..., 3)` by unit quaternions `(..., 4)`."""
    u = q[..., :3]
    t = 2.0 * _cross(u, v)
    return v + q[..., 3:] * t + _cross(u, t)


def _cross(a: Array, b: Array) -> Array:
    """`np.cross` of vectors `(..., 3)`, in a tenth of its time for the few vectors of a hand."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    product = np.empty(np.broadcast_shapes(a.shape, b.shape))
    product[..., 0] = ay * bz - az * by
    product[..., 1] = az * bx - ax * bz
    product[..., 2] = ax * by - ay * bx
    return product


def continuous_quats(q: Array) -> Array:
    """The same rotations `(T, 4)` with signs chosen so that each quaternion is in its predecessor's hemisphere."""
    flips = np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0)
    return q * np.cumprod(np.concatenate([[1.0], flips]))[:, None]


def quat_normalize(q: Array) -> Array:
    """Unit quaternions; raises `ValueError` where the length is zero or not finite."""
    length = np.linalg.norm(q, axis=-1, keepdims=True)
    if not (np.all(np.isfinite(length)) and np.all(length > 1e-9)):
        raise ValueError("quaternion has no direction: its length must be finite and above 1e-9")
    return q / length


def quat_exp(rotation_vector: Array) -> Array:
    """Rotation vector `(..., 3)` in radians to unit quaternion `(..., 4)`."""
    half = 0.5 * np.linalg.norm(rotation_vector, axis=-1, keepdims=True)
    return np.concatenate([0.5 * rotation_vector * np.sinc(half / np.pi), np.cos(half)], axis=-1)


def quat_log(q: Array) -> Array:
    """Unit quaternion `(..., 4)` to the shortest rotation vector `(..., 3)`, radians."""
    q = np.where(q[..., 3:] < 0.0, -q, q)
    sine = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, q[..., 3:])
    return q[..., :3] * np.where(sine < 1e-9, 2.0, angle / np.maximum(sine, 1e-12))


def quat_slerp(a: Array, b: Array, fraction: Array | float) -> Array:
    """Shortest-arc interpolation from `a` to `b`; `fraction` broadcasts against `(...)`."""
    step = quat_log(quat_multiply(quat_conjugate(a), b))
    return quat_multiply(a, quat_exp(step * np.asarray(fraction, dtype=np.float64)[..., None]))


def quat_to_matrix(q: Array) -> Array:
    """Unit quaternions `(..., 4)` to rotation matrices `(..., 3, 3)`."""
    x, y, z, w = np.moveaxis(q, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def matrix_to_quat(m: Array) -> Array:
    """Rotation matrices `(..., 3, 3)` to unit quaternions `(..., 4)` with w >= 0.

    Shepperd's method by the largest of the four squared components, so it is stable at every angle.
    """
    m00, m11, m22 = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    candidates = np.empty((*m.shape[:-2], 4, 4))
    candidates[..., 0, 0] = 1 + m00 - m11 - m22
    candidates[..., 1, 1] = 1 - m00 + m11 - m22
    candidates[..., 2, 2] = 1 - m00 - m11 + m22
    candidates[..., 3, 3] = 1 + m00 + m11 + m22
    candidates[..., 0, 1] = candidates[..., 1, 0] = m[..., 0, 1] + m[..., 1, 0]
    candidates[..., 0, 2] = candidates[..., 2, 0] = m[..., 0, 2] + m[..., 2, 0]
    candidates[..., 1, 2] = candidates[..., 2, 1] = m[..., 1, 2] + m[..., 2, 1]
    candidates[..., 0, 3] = candidates[..., 3, 0] = m[..., 2, 1] - m[..., 1, 2]
    candidates[..., 1, 3] = candidates[..., 3, 1] = m[..., 0, 2] - m[..., 2, 0]
    candidates[..., 2, 3] = candidates[..., 3, 2] = m[..., 1, 0] - m[..., 0, 1]
    pivot = np.argmax(np.diagonal(candidates, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(candidates, pivot[..., None, None], axis=-2)[..., 0, :]
    q /= np.sqrt(np.sum(q * q, axis=-1, keepdims=True))
    return np.where(q[..., 3:] < 0.0, -q, q)


def compose(T_a_b: Array, T_b_c: Array) -> Array:
    """Poses `(..., 7)`: `T_a_c = T_a_b · T_b_c`."""
    p = T_a_b[..., :3] + quat_rotate(T_a_b[..., 3:], T_b_c[..., :3])
    return np.concatenate([p, quat_multiply(T_a_b[..., 3:], T_b_c[..., 3:])], axis=-1)


def invert(T_a_b: Array) -> Array:
    """Poses `(..., 7)`: `T_b_a`."""
    q = quat_conjugate(T_a_b[..., 3:])
    return np.concatenate([-quat_rotate(q, T_a_b[..., :3]), q], axis=-1)


def transform(T_a_b: Array, p_b: Array) -> Array:
    """Points `(..., 3)` from frame b to frame a."""
    return T_a_b[..., :3] + quat_rotate(T_a_b[..., 3:], p_b)


def scale_positions(T: Array, factor: float) -> Array:
    """Poses `(..., 7)` with their positions multiplied by `factor` and their rotations kept."""
    return T * np.array([factor, factor, factor, 1.0, 1.0, 1.0, 1.0])


def mirror_points(p: Array) -> Array:
    """Reflect points or polar vectors `(..., 3)` through x = 0."""
    return p * np.array([-1.0, 1.0, 1.0])


def mirror_quats(q: Array) -> Array:
    """Reflect rotations `(..., 4)` through x = 0: `R' = S R S`."""
    return q * np.array([1.0, -1.0, -1.0, 1.0])


def mirror_poses(T: Array) -> Array:
    """Reflect poses `(..., 7)` through x = 0."""
    return T * np.array([-1.0, 1.0, 1.0, 1.0, -1.0, -1.0, 1.0])
