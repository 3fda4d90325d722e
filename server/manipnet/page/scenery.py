"""The surroundings of the hands: lights, and a round table below everything that was shown."""

from typing import Final

import numpy as np
import viser

from manipnet.geometry import Array

TABLE_M: Final = (0.75, 0.03)
"""Radius and thickness."""
TABLE_COLOR: Final = (58, 63, 72)
EDGE_COLOR: Final = (96, 104, 118)
GAP_M: Final = 0.001
"""The table lies this far below the lowest point, so that the faces of a prop that stands on it do not flicker."""
KEY, RIM = (0.35, 1.4, 0.55), (-0.8, 0.6, -0.9)
"""The directions from which the lights shine."""


def add_lights(scene: viser.SceneApi) -> None:
    """The lights of every visitor's scene."""
    scene.set_up_direction("+y")
    scene.configure_default_lights(enabled=False)
    scene.configure_environment_map("studio", environment_intensity=0.22)
    scene.add_light_hemisphere("/light/sky", sky_color=(255, 250, 244), ground_color=(40, 44, 54), intensity=0.4)
    scene.add_light_directional("/light/key", color=(255, 240, 222), intensity=2.3, cast_shadow=True, position=KEY)
    scene.add_light_directional("/light/rim", color=(160, 195, 255), intensity=1.1, cast_shadow=False, position=RIM)


class Table:
    """A round table under `name`. It is there from the beginning, at the world's origin."""

    def __init__(self, scene: viser.SceneApi, name: str) -> None:
        self._frame = scene.add_frame(name, show_axes=False, wxyz=(np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0))
        # viser's cylinders stand along z
        radius_m, thickness_m = TABLE_M
        scene.add_cylinder(
            f"{name}/top", radius_m, thickness_m, color=TABLE_COLOR, radial_segments=160, cast_shadow=False
        )
        scene.add_cylinder(
            f"{name}/edge",
            radius_m + 0.006,
            0.6 * thickness_m,
            color=EDGE_COLOR,
            radial_segments=160,
            cast_shadow=False,
        )
        self.place(np.zeros((1, 3)), 0.0)

    def place(self, points: Array, floor_m: float) -> None:
        """Put the table below `points (n, 3)`, of which the lowest has the height `floor_m`."""
        x, _, z = 0.5 * (points.min(axis=0) + points.max(axis=0))
        self._top_m = floor_m - GAP_M
        self._frame.position = (x, self._top_m - 0.5 * TABLE_M[1], z)

    def lower(self, floor_m: float) -> None:
        """Lower the table below `floor_m` if it is above."""
        if floor_m - GAP_M < self._top_m:
            x, _, z = self._frame.position
            self._top_m = floor_m - GAP_M
            self._frame.position = (x, self._top_m - 0.5 * TABLE_M[1], z)
