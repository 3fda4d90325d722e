"""Retargeting to any rig: its finger bones point where the hand's do, whatever their axes, lengths and bind pose.

All axes are right-handed, as in the messages and in Blender; quaternions are xyzw.
"""

from __future__ import annotations

import unicodedata

import numpy as np

from .layout import ZERO_POSITIONS, ZERO_ROTATIONS
from .message import Hand
from .rig_names import FINGER_BONES, HAND_BONES, METACARPALS, THUMB_METACARPALS

FINGERS = ("Thumb", "Index", "Middle", "Ring", "Little")
PARTS = ("Proximal", "Intermediate", "Distal")
BONES = np.arange(2, 17)
"""The hand's bone for each finger bone of a rig. Rigs combine the two carpal angles of the thumb in its first bone."""

_ENDS = np.array([17 + i // 3 if i % 3 == 2 else 3 + i for i in range(15)])
_PARENTS = (-1, 0, 1, 2, 3, 0, 5, 6, 0, 8, 9, 0, 11, 12, 0, 14, 15)
_KNUCKLES = (3, 6, 9, 12)


class HandRig:
    """Poses the finger bones of one hand of a rig.

    The bind pose is given in the space of the rig's hand bone: `positions (15, 3)` and `rotations (15, 4)`, thumb to
    little finger, proximal to distal, and `tips (5, 3)`, the end of each finger's last bone. The rows of bones that the
    rig lacks are NaN. Raises `ValueError` if fewer than two fingers beside the thumb have a first bone.
    """

    def __init__(self, side: str, positions: np.ndarray, rotations: np.ndarray, tips: np.ndarray) -> None:
        flip = 1.0 if side == "right" else -1.0
        zero_p = ZERO_POSITIONS * [flip, 1.0, 1.0]
        zero_q = ZERO_ROTATIONS * [1.0, flip, flip, 1.0]
        present = ~np.isnan(positions[:, 0])
        knuckles = [i for i in _KNUCKLES if present[i]]
        if len(knuckles) < 2:
            raise ValueError("the rig needs the first bones of at least two fingers beside the thumb")
        first, last = knuckles[0], knuckles[-1]
        middle = 6 if present[6] else first
        ours = _frame(zero_p[BONES[middle]], zero_p[BONES[first]] - zero_p[BONES[last]])
        theirs = _frame(positions[middle], positions[first] - positions[last])
        self.wrist_to_hand = multiply(theirs, conjugate(ours))
        self._bind = np.tile([0.0, 0.0, 0.0, 1.0], (15, 1))
        for i in np.flatnonzero(present):
            below = [j for j in range(i + 1, 3 * (i // 3) + 3) if present[j]]
            end, our_end = (positions[below[0]], BONES[below[0]]) if below else (tips[i // 3], _ENDS[i])
            wanted = rotate(self.wrist_to_hand, zero_p[our_end] - zero_p[BONES[i]])
            turned = multiply(from_to(end - positions[i], wanted), rotations[i])
            back = multiply(conjugate(zero_q[BONES[i]]), conjugate(self.wrist_to_hand))
            self._bind[i] = multiply(back, turned)

    def hand_place(self, hand: Hand) -> np.ndarray:
        """Where the rig's hand bone is in the world, `(3,)`."""
        return hand.wrist[:3]

    def hand_rotation(self, hand: Hand) -> np.ndarray:
        """The world rotation `(4,)` of the rig's hand bone that follows the tracked wrist."""
        return multiply(hand.wrist[3:], conjugate(self.wrist_to_hand))

    def solve(self, hand: Hand) -> np.ndarray:
        """The rotations `(15, 4)` of the finger bones in the space of the rig's hand bone."""
        world = np.empty((17, 4))
        world[0] = self.wrist_to_hand
        for bone in range(1, 17):
            world[bone] = multiply(world[_PARENTS[bone]], hand.rotations[bone])
        out = np.array([multiply(world[bone], bind) for bone, bind in zip(BONES, self._bind, strict=True)])
        return out / np.linalg.norm(out, axis=1, keepdims=True)


def matches(bone: str, side: str, finger: int, part: int, thumb_metacarpal: bool = False) -> bool:
    """Whether the name `bone` of a rig means this bone of this finger, both counted from zero.

    It knows the names that are listed in `clients/README.md`. Rigs of VRM 1 and Godot have a `thumb_metacarpal`
    (`is_thumb_metacarpal`), and call the second bone of the thumb proximal.
    """
    name, letter = _plain(bone), side[0]
    if finger == 0 and bone[:-3] == "Thumb" and bone[-2:] in ("_L", "_R"):  # VRChat counts the thumb from zero
        return bone[-1].lower() == letter and bone[-3] == str(part)
    if is_thumb_metacarpal(bone, side):
        return (finger, part) == (0, 0)
    if finger == 0 and thumb_metacarpal and part < 2:
        return part == 1 and name in (f"{side}thumbproximal", f"thumbproximal{letter}")
    return name in FINGER_BONES[side][len(PARTS) * finger + part].split()


def is_thumb_metacarpal(bone: str, side: str) -> bool:
    """Whether the name `bone` means the first bone of a thumb, as in VRM 1 and Godot."""
    return _plain(bone) in THUMB_METACARPALS[side][0].split()


def is_metacarpal(bone: str, side: str, finger: int) -> bool:
    """Whether the name `bone` means the bone in the palm that leads to a finger, counted from zero for the thumb."""
    return finger > 0 and _plain(bone) in METACARPALS[side][finger - 1].split()


def is_hand(bone: str, side: str) -> bool:
    """Whether the name `bone` of a rig means the hand itself."""
    return _plain(bone) in HAND_BONES[side][0].split()


def _plain(name: str) -> str:
    return "".join(c for c in unicodedata.normalize("NFKC", name.rpartition(":")[2]) if c.isalnum()).lower()


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The rotation `b` followed by `a`, each `(4,)`."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return np.array(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ]
    )


def conjugate(q: np.ndarray) -> np.ndarray:
    """The inverse of a unit quaternion."""
    return q * [-1.0, -1.0, -1.0, 1.0]


def rotate(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """A vector `(3,)`, rotated by a unit quaternion."""
    t = 2.0 * np.cross(q[:3], v)
    return v + q[3] * t + np.cross(q[:3], t)


def from_to(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """The shortest rotation `(4,)` from one direction to another."""
    start, end = start / np.linalg.norm(start), end / np.linalg.norm(end)
    q = np.append(np.cross(start, end), 1.0 + start @ end)
    if q[3] < 1e-6:  # opposite directions: half a turn about any perpendicular axis
        q = np.append(np.cross(start, [1.0, 0.0, 0.0] if abs(start[0]) < 0.7 else [0.0, 1.0, 0.0]), 0.0)
    return q / np.linalg.norm(q)


def _frame(along: np.ndarray, across: np.ndarray) -> np.ndarray:
    """The rotation `(4,)` of a frame with x along `along` and y towards `across`."""
    first = from_to(np.array([1.0, 0.0, 0.0]), along)
    unit = along / np.linalg.norm(along)
    _, y, z = rotate(conjugate(first), across - (across @ unit) * unit)
    half = 0.5 * np.arctan2(z, y)
    return multiply(first, np.array([np.sin(half), 0.0, 0.0, np.cos(half)]))
