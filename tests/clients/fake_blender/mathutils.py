"""The types of Blender's mathutils that the extension uses."""

import numpy as np
from scipy.spatial.transform import Rotation


class Vector(tuple):
    pass


class Quaternion(tuple):
    """A quaternion in the order w, x, y, z."""


class Matrix:
    """A 4x4 matrix."""

    def __init__(self, rows):
        self.rows = np.array(rows.rows if isinstance(rows, Matrix) else rows, float)

    @classmethod
    def LocRotScale(cls, place, turn, scale):  # noqa: N802
        assert scale is None
        rows = np.eye(4)
        rows[:3, :3] = Rotation.from_quat([*turn[1:], turn[0]]).as_matrix()
        rows[:3, 3] = place
        return cls(rows)

    def __matmul__(self, other):
        return Matrix(self.rows @ other.rows)

    def inverted(self):
        return Matrix(np.linalg.inv(self.rows))

    def to_quaternion(self):
        x, y, z, w = Rotation.from_matrix(self.rows[:3, :3]).as_quat()
        return Quaternion((w, x, y, z))
