"""Free hands of several proportions that the package ships: profiles for the second solve, and skins to draw them.

`assets/CREDITS.md` says where they come from. `manipnet_tools.assets.shipped_hands` makes the files.
"""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import Array, Side, compose, invert, mirror_points, mirror_poses, quat_rotate
from manipnet.synthesis.hand.profile import HandProfile, ProfileError, read_profile
from manipnet.synthesis.hand.shipped_files import FOLDER, NAMES


@dataclass(frozen=True, eq=False)
class HandMesh:
    """The skin of a hand, in the frame of its OpenXR wrist joint, metres."""

    vertices: Array
    """`(V, 3)` in the pose `bind`."""
    faces: NDArray[np.int64]
    """`(F, 3)`, counter-clockwise from outside."""
    bones: NDArray[np.int64]
    """`(V, 4)` numbers of the OpenXR joints that move each vertex."""
    weights: Array
    """`(V, 4)` the share of each of them; they sum to one."""
    bind: Array
    """`(26, 7)` the OpenXR joints in the pose of the vertices."""
    opacity: Array
    """`(V,)` 1 on the hand, falling to 0 at the end of the forearm."""

    def posed(self, joints: Array) -> Array:
        """The vertices `(V, 3)` where the OpenXR joints are at `joints (26, 7)`, in the frame of those."""
        turns = compose(joints, invert(self.bind))[self.bones]
        placed = quat_rotate(turns[..., 3:], self.vertices[:, None]) + turns[..., :3]
        return (self.weights[..., None] * placed).sum(axis=1)


def names() -> tuple[str, ...]:
    """The names of the shipped hands."""
    return NAMES


@cache
def load(name: str) -> HandProfile:
    """The profile of a shipped hand. Raises `ProfileError` for an unknown name."""
    return read_profile(_file(name, ".json"))


@cache
def mesh(name: str, side: Side = "right") -> HandMesh:
    """The skin of a shipped hand. Raises `ProfileError` for an unknown name."""
    with np.load(_file(name, ".npz"), allow_pickle=False) as stored:
        vertices, faces = stored["vertices"].astype(np.float64), stored["faces"].astype(np.int64)
        bones, opacity = stored["bones"].astype(np.int64), stored["opacity"] / 255.0
        weights, bind = stored["weights"] / 255.0, stored["bind"].astype(np.float64)
    weights /= weights.sum(axis=1, keepdims=True)
    if side == "left":
        vertices, faces, bind = mirror_points(vertices), faces[:, ::-1], mirror_poses(bind)
    return HandMesh(vertices, faces, bones, weights, bind, opacity)


def _file(name: str, suffix: str) -> Path:
    if name not in NAMES:
        raise ProfileError(f"there is no shipped hand {name!r}; shipped are {', '.join(NAMES)}")
    return FOLDER / f"{name}{suffix}"
