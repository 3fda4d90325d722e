"""The surroundings of the hands: lights, a round table, and the first view of each camera."""

from typing import Final

import numpy as np
import viser

from manipnet.geometry import Array

TABLE_M: Final = (0.62, 0.03)
"""Radius and thickness."""
TABLE_COLOR: Final = (66, 71, 80)
VIEW: Final = np.array([0.22, 0.50, 0.85])
"""Offset of the camera from the hands."""
VIEW_M: Final = 0.92
KEY_M, RIM_M = np.array([0.35, 1.4, 0.55]), np.array([-0.8, 0.6, -0.9])
"""Offsets of the lights from the hands."""
FIELD_OF_VIEW_RAD: Final = 0.70


class Scenery:
    """The lights and the table. The table stands below everything that has been shown so far."""

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._table: viser.CylinderHandle | None = None
        self._center = np.zeros(3)
        scene.set_up_direction("+y")
        scene.configure_default_lights(enabled=False)
        scene.configure_environment_map("studio", environment_intensity=0.22)
        scene.add_light_hemisphere("/light/sky", sky_color=(255, 250, 244), ground_color=(40, 44, 54), intensity=0.4)
        self._key = scene.add_light_directional("/light/key", color=(255, 240, 222), intensity=2.3, cast_shadow=True)
        self._rim = scene.add_light_directional("/light/rim", color=(160, 195, 255), intensity=1.1, cast_shadow=False)

    @property
    def placed(self) -> bool:
        """Whether anything has been shown."""
        return self._table is not None

    def place(self, points: Array, floor_m: float) -> None:
        """Place the table at the height `floor_m`, below `points (n, 3)`; cameras look at the middle of the points."""
        self._center = 0.5 * (points.min(axis=0) + points.max(axis=0))
        x, _, z = self._center
        if self._table is not None:
            self._table.remove()
        self._table = self._scene.add_cylinder(
            "/table",
            *TABLE_M,
            color=TABLE_COLOR,
            radial_segments=128,
            position=(x, floor_m - 0.5 * TABLE_M[1], z),
            wxyz=(np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0),  # viser's cylinders stand along z
            cast_shadow=False,
        )
        self._key.position = tuple(self._center + KEY_M)
        self._rim.position = tuple(self._center + RIM_M)

    def lower(self, floor_m: float) -> None:
        """Lower the table to `floor_m` if it is above."""
        if self._table is not None and floor_m < self._table.position[1] + 0.5 * TABLE_M[1]:
            x, _, z = self._table.position
            self._table.position = (x, floor_m - 0.5 * TABLE_M[1], z)

    def look(self, camera: viser.CameraHandle) -> None:
        """Point a visitor's camera at the hands."""
        back = VIEW / np.linalg.norm(VIEW)
        camera.up_direction = (0.0, 1.0, 0.0)
        camera.fov = FIELD_OF_VIEW_RAD
        camera.position = tuple(self._center + VIEW_M * back)
        camera.look_at = self._center
