"""A forearm that fades out, in pieces of falling opacity: viser's meshes have one opacity each.

(A GLB file could have one per vertex, but viser's reader of such files evaluates text, which the page forbids.)
"""

from typing import Final

import numpy as np
import viser

from manipnet.geometry import Array

LEVELS: Final = 12
"""Opacities between nothing and all."""


class Forearm:
    """A rigid mesh under `name`, drawn in pieces."""

    def __init__(
        self,
        scene: viser.SceneApi,
        name: str,
        vertices: Array,
        faces: np.ndarray,
        opacity: Array,
        color: tuple[int, int, int],
    ) -> None:
        """`vertices (V, 3)` are in the frame of `pose`; `opacity (V,)` is 0 to 1."""
        self._frame = scene.add_frame(name, show_axes=False)
        level = np.round(LEVELS * opacity[faces].mean(axis=1)).astype(int)
        self._pieces = [
            scene.add_mesh_simple(
                f"{name}/{number}",
                vertices,
                faces[level == number],
                color=color,
                opacity=min(number / LEVELS, 0.98),
                cast_shadow=False,
                receive_shadow=False,
            )
            for number in range(1, LEVELS + 1)
            if (level == number).any()
        ]

    def pose(self, position: Array, wxyz: Array) -> None:
        """Move it."""
        self._frame.position, self._frame.wxyz = position, wxyz

    def paint(self, color: tuple[int, int, int]) -> None:
        """Change its colour."""
        for piece in self._pieces:
            piece.color = color
