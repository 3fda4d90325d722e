"""Whether contacts can hold an object, and how hard each must press.

Contacts push with friction, as four-sided cones. A grasp must carry the object whichever way gravity points; forces are
in units of its weight, and torques are divided by `ARM_M` (`manipnet.synthesis.ik.grasp` asks the same at run time).
"""

from typing import Final

import numpy as np
from scipy.optimize import nnls

from manipnet.geometry import Array

FRICTION: Final = 0.5
ARM_M: Final = 0.05
MISSING: Final = 0.1
"""The share of the weight that may remain unexplained."""
SIDES: Final = np.concatenate([np.eye(3), -np.eye(3)])


def cone_columns(points: Array, normals: Array, centre: Array, friction: float = FRICTION) -> Array:
    """Wrenches `(6, 4 n)` of unit pushes at `points (n, 3)` into the object, whose surface looks along `normals`."""
    helper = np.where(np.abs(normals[:, :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    u: Array = np.cross(normals, helper)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v: Array = np.cross(normals, u)
    forces = np.stack([-normals + friction * side for side in (u, -u, v, -v)], axis=1)
    torques = np.cross((points - centre)[:, None], forces) / ARM_M
    return np.concatenate([forces, torques], axis=2).reshape(-1, 6).T


def carried(columns: Array, directions: Array = SIDES) -> Array:
    """For which of the `directions (n, 3)` of gravity the contacts carry the object, `(n,)`."""
    if not columns.size:
        return np.zeros(len(directions), dtype=bool)
    return np.array([nnls(columns, np.r_[-down, 0.0, 0.0, 0.0])[1] < MISSING for down in directions])


def squeeze(points: Array, normals: Array, centre: Array, total_n: float) -> Array:
    """Forces `(n, 3)` on the object that cancel each other, `total_n` newtons together along the normals.

    Each contact presses at least a little; what cannot be balanced remains small, by least squares.
    """
    columns = cone_columns(points, normals, centre)
    count = len(points)
    least = np.full(4 * count, 0.25 * 0.3 / count)
    sums = np.full((1, 4 * count), 4.0)
    shares, _ = nnls(np.concatenate([columns, sums]), np.r_[-(columns @ least), 4.0 * (1.0 - least.sum())])
    forces = cone_columns(points, normals, centre)[:3] * (shares + least)
    return total_n * forces.T.reshape(count, 4, 3).sum(axis=1)
