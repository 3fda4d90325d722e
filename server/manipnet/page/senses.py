"""What a hand sensed and aimed for at a tick, computed anew for the eye: in the page's process, by the same kernels."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from manipnet.geometry import Array, mirror_points, mirror_poses, transform
from manipnet.ik.senses import present_senses
from manipnet.objects.mesh import ClosedMesh
from manipnet.objects.shape import Shape, build_shape
from manipnet.page.frames import Frame, ShapeView
from manipnet.sensing.ambient import CELL_M, CELLS, CENTER_M
from manipnet.streams.wire import Side

_STEPS: Final = (np.arange(CELLS) - 0.5 * (CELLS - 1)) * CELL_M
CELL_CENTERS: Final = CENTER_M + np.stack(np.meshgrid(_STEPS, _STEPS, _STEPS, indexing="ij"), axis=-1).reshape(-1, 3)
"""`(1000, 3)` in the wrist frame of a right hand, in the order of the sensor."""


@dataclass(frozen=True, eq=False)
class Senses:
    """One hand's, in the world: occupancy `ambient (1000,)` of `cells (1000, 3)`; sensor `points`, `normals (104, 3)`
    and `readings (104,)` in metres; joints before `raw (22, 3)` and `targets (22, 3)` of inverse kinematics."""

    cells: Array
    ambient: np.ndarray
    points: Array
    normals: Array
    readings: Array
    raw: Array
    targets: Array


class Senser:
    """Senses with shapes, each of which is built, or read from the cache, once."""

    def __init__(self) -> None:
        self._shapes: dict[str, Shape] = {}

    def sense(self, frame: Frame, side: Side, view: ShapeView, prop_scale: float) -> Senses:
        """What the hand of one side sensed of the shape it was about."""
        hand, size = frame.hands[side], frame.message.hands[side].scale
        wrist, obj = (_present(frame, name, size) for name in (f"{side}_wrist", hand.prop))
        mirrored = side == "left"
        if mirrored:
            wrist, obj = mirror_poses(wrist), mirror_poses(obj)
        local = present_senses(
            self._shape(view),
            wrist,
            obj,
            mirrored,
            prop_scale / size,
            hand.positions,
            hand.rotations,
            hand.raw_positions,
            hand.distances,
        )

        def world(points: Array) -> Array:
            real = mirror_points(points) if mirrored else points
            return transform(_present(frame, f"{side}_wrist", 1.0), size * real)

        origin = world(np.zeros((1, 3)))
        return Senses(
            world(CELL_CENTERS),
            local.ambient,
            world(local.points),
            (world(local.normals) - origin) / size,
            local.readings * size,
            world(hand.raw_positions),
            world(local.targets),
        )

    def _shape(self, view: ShapeView) -> Shape:
        if view.content_hash not in self._shapes:
            mesh = ClosedMesh(view.name, view.vertices, view.faces, view.content_hash)
            self._shapes[view.content_hash] = build_shape(mesh)
        return self._shapes[view.content_hash]


def _present(frame: Frame, name: str, size: float) -> Array:
    """Where a body is at the tick, as a hand of the model's size would see it."""
    pose = frame.windows[name][len(frame.windows[name]) // 2].copy()
    pose[:3] /= size
    return pose
