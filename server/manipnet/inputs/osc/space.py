"""The frame of reference and the units in which an OSC sender gives poses, and their conversion to ours."""

import math
from dataclasses import dataclass
from typing import Final

Numbers = tuple[float, ...]

AXES: Final = {"y-up": "x y z", "z-up": "x z -y", "unity": "-x y z", "z-up left": "-x z -y"}
"""Names for common axes. Each entry says what our x, y and z are in the sender's axes."""
ROTATION_ORDERS: Final = ("xyz", "xzy", "yxz", "yzx", "zxy", "zyx")
_LETTERS: Final = "xyz"
_NAN: Final = (math.nan,) * 4


@dataclass(frozen=True)
class Space:
    """How to convert a sender's poses: `axes` as in `AXES`, the size of its unit in metres, and its Euler angles.

    `rotation_order` names the fixed axes about which the three Euler angles turn, the first turn first; `angle` is the
    size of the unit of angles in radians. Raises `ValueError` for axes that are not x, y and z with signs.
    """

    axes: str = AXES["y-up"]
    unit_m: float = 1.0
    rotation_order: str = "zxy"
    angle: float = math.radians(1.0)

    def __post_init__(self) -> None:
        read_axes(self.axes)

    @property
    def is_ours(self) -> bool:
        """Whether positions and quaternions need no conversion."""
        return read_axes(self.axes) == read_axes("y-up") and self.unit_m == 1.0

    def converter(self) -> "Converter":
        """The conversion, ready to be used."""
        return Converter(self)


class Converter:
    """Converts positions and rotations from a `Space` to the project frame."""

    def __init__(self, space: Space) -> None:
        axes = read_axes(space.axes)
        hand = _determinant(axes)
        self._metres = [(i, sign * space.unit_m) for i, sign in axes]
        self._turns = [(i, sign * hand) for i, sign in axes]
        self._angle = space.angle
        self._order = [_LETTERS.index(letter) for letter in space.rotation_order]
        self._parity = _parity(*self._order)

    def position(self, p: Numbers) -> Numbers:
        """A position in metres, from three numbers."""
        (i, a), (j, b), (k, c) = self._metres
        return a * p[i], b * p[j], c * p[k]

    def rotation(self, q: Numbers) -> Numbers:
        """A quaternion x y z w. The axis of a rotation changes its sign when axes of the other hand are mirrored."""
        (i, a), (j, b), (k, c) = self._turns
        return a * q[i], b * q[j], c * q[k], q[3]

    def pose(self, pose: Numbers) -> Numbers:
        """A position in metres and a quaternion x y z w, from seven numbers."""
        (i, a), (j, b), (k, c) = self._metres
        (_, d), (_, e), (_, f) = self._turns
        return a * pose[i], b * pose[j], c * pose[k], d * pose[i + 3], e * pose[j + 3], f * pose[k + 3], pose[6]

    def euler_pose(self, pose: Numbers) -> Numbers:
        """A position in metres and a quaternion x y z w, from a position and three angles."""
        return self.position(pose) + self.euler(pose[3:])

    def euler(self, angles: Numbers) -> Numbers:
        """A quaternion x y z w from the angles about the sender's x, y and z axes."""
        if not all(map(math.isfinite, angles)):
            return _NAN
        i, j, k = self._order  # the first, the second and the third turn, whose quaternions are multiplied
        a, b, c = (0.5 * self._angle * angles[axis] for axis in self._order)
        sa, ca, sb, cb, sc, cc = math.sin(a), math.cos(a), math.sin(b), math.cos(b), math.sin(c), math.cos(c)
        even = self._parity
        q = [0.0, 0.0, 0.0, ca * cb * cc + even * sa * sb * sc]
        q[i] = sa * cb * cc - even * ca * sb * sc
        q[j] = ca * sb * cc + even * sa * cb * sc
        q[k] = ca * cb * sc - even * sa * sb * cc
        return self.rotation(tuple(q))


def read_axes(text: str) -> tuple[tuple[int, float], tuple[int, float], tuple[int, float]]:
    """For each of our axes, which of the sender's it is, and its sign. Raises `ValueError`."""
    found = [(word.lstrip("-+"), -1.0 if word.startswith("-") else 1.0) for word in AXES.get(text, text).split()]
    if sorted(letter for letter, _ in found) != list(_LETTERS):
        raise ValueError(f"axes are {text!r}; they must be {', '.join(AXES)}, or x, y and z with signs, like 'x z -y'")
    x, y, z = ((_LETTERS.index(letter), sign) for letter, sign in found)
    return x, y, z


def _determinant(rows: tuple[tuple[int, float], ...]) -> float:
    (i, a), (j, b), (k, c) = rows
    return a * b * c * _parity(i, j, k)


def _parity(i: int, j: int, k: int) -> float:
    """1 for an even permutation of 0, 1 and 2, and -1 for an odd one."""
    return 1.0 if (i, j, k) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1.0
