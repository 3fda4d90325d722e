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
        (self._x, self._y, self._z) = read_axes(space.axes)
        self._hand = _determinant((self._x, self._y, self._z))
        self._unit_m, self._angle = space.unit_m, space.angle
        self._order = [_LETTERS.index(letter) for letter in space.rotation_order]

    def position(self, p: Numbers) -> Numbers:
        """A position in metres, from three numbers."""
        (i, a), (j, b), (k, c) = self._x, self._y, self._z
        unit_m = self._unit_m
        return a * unit_m * p[i], b * unit_m * p[j], c * unit_m * p[k]

    def rotation(self, q: Numbers) -> Numbers:
        """A quaternion x y z w. The axis of a rotation changes its sign when axes of the other hand are mirrored."""
        (i, a), (j, b), (k, c) = self._x, self._y, self._z
        hand = self._hand
        return hand * a * q[i], hand * b * q[j], hand * c * q[k], q[3]

    def euler(self, angles: Numbers) -> Numbers:
        """A quaternion x y z w from the angles about the sender's x, y and z axes."""
        if not all(map(math.isfinite, angles)):
            return _NAN
        q = (0.0, 0.0, 0.0, 1.0)
        for axis in self._order:
            half = 0.5 * self._angle * angles[axis]
            turn = [0.0, 0.0, 0.0, math.cos(half)]
            turn[axis] = math.sin(half)
            q = _times(turn, q)
        return self.rotation(q)


def read_axes(text: str) -> tuple[tuple[int, float], tuple[int, float], tuple[int, float]]:
    """For each of our axes, which of the sender's it is, and its sign. Raises `ValueError`."""
    found = [(word.lstrip("-+"), -1.0 if word.startswith("-") else 1.0) for word in AXES.get(text, text).split()]
    if sorted(letter for letter, _ in found) != list(_LETTERS):
        raise ValueError(f"axes are {text!r}; they must be {', '.join(AXES)}, or x, y and z with signs, like 'x z -y'")
    x, y, z = ((_LETTERS.index(letter), sign) for letter, sign in found)
    return x, y, z


def _determinant(rows: tuple[tuple[int, float], ...]) -> float:
    (i, a), (j, b), (k, c) = rows
    even = (i, j, k) in ((0, 1, 2), (1, 2, 0), (2, 0, 1))
    return a * b * c * (1.0 if even else -1.0)


def _times(a: list[float], b: Numbers) -> Numbers:
    """The product of two quaternions x y z w: first `b`, then `a`."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )
