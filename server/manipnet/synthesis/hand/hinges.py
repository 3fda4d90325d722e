"""Geometry of hinges and bones: frames of OpenXR, turns about axes, and the angles that lead from one to another."""

import numpy as np

from manipnet.geometry import Array, quat_exp, quat_to_matrix


def openxr_frame(along: Array, back: Array) -> Array:
    """Columns of the OpenXR frame of a bone that points `along`, whose back side faces about `back`."""
    z = -unit(along)
    if np.linalg.norm(np.cross(back, z)) < 1e-3 * np.linalg.norm(back) + 1e-9:  # no hint: any direction across the bone
        back = np.eye(3)[np.argmin(np.abs(z))]
    x = unit(np.cross(back, z))
    return np.stack([x, np.cross(z, x), z], axis=1)


def unit(v: Array) -> Array:
    """The direction of a vector `(3,)`; zero stays zero."""
    return v / max(float(np.linalg.norm(v)), 1e-12)


def turn_matrix(axis: Array, angle: float) -> Array:
    """The rotation `(3, 3)` about an axis."""
    return quat_to_matrix(quat_exp(unit(axis) * angle))


def bend_between(before: Array, after: Array, hinge: Array) -> float:
    """The angle (rad) about a hinge from one direction to another."""
    return float(np.arctan2(hinge @ np.cross(before, after), before @ after - (hinge @ before) * (hinge @ after)))


def aim_hinges(first: Array, second: Array, start: Array, end: Array) -> Array:
    """The angles `(2,)` of two hinges, the second carried by the first, that turn `start` nearest to `end`."""
    angles = np.zeros(2)
    for _ in range(20):
        outer = turn_matrix(first, angles[0])
        inner = turn_matrix(second, angles[1]) @ start
        here = outer @ inner
        jacobian = np.stack([np.cross(first, here), outer @ np.cross(second, inner)], axis=1)
        step = np.linalg.solve(jacobian.T @ jacobian + 1e-3 * np.eye(2), jacobian.T @ (end - here))
        angles += np.clip(step, -0.3, 0.3)
    return angles
