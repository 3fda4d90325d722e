"""What a hand senses and aims for at a tick, computed for display in the page's process with the network's kernels.

The sensors are those of the hand as it is shown. The network's own were on the pose it went on from, a tick before and
without its grip: they would be up to a centimetre beside the fingers.
"""

from dataclasses import dataclass

import numpy as np

from manipnet.geometry import Array, mirror_points, mirror_poses, scale_positions
from manipnet.page.frames import Frame, ShapeView
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.ik.snapshot import take_snapshot
from manipnet.synthesis.objects.mesh import ClosedMesh
from manipnet.synthesis.objects.shape import Shape, build_shape
from manipnet.synthesis.sensing.ambient import CELL_OFFSETS_M
from manipnet.wire import Side


@dataclass(frozen=True, eq=False)
class Senses:
    """One hand's, in the frame of its `wrist (7,)`: occupancy `ambient (1000,)` of `cells (1000, 3)`; sensor `points`,
    `normals (104, 3)` and `readings (104,)` in metres; joints before `raw (22, 3)` and `targets (22, 3)` of inverse
    kinematics."""

    wrist: Array
    cells: Array
    ambient: np.ndarray
    points: Array
    normals: Array
    readings: Array
    raw: Array
    targets: Array


class Senser:
    """Computes snapshots; each shape is built, or read from the cache, once."""

    def __init__(self, hand: Hand) -> None:
        self._hand = hand
        self._shapes: dict[str, Shape] = {}

    def sense(self, frame: Frame, side: Side, view: ShapeView, prop_scale: float) -> Senses:
        """The snapshot of one hand and the shape of its prop."""
        hand, shown = frame.hands[side], frame.message.hands[side]
        size, positions, rotations = shown.scale, *forward_kinematics(self._hand, np.asarray(shown.angles, np.float64))
        wrist, obj = (
            scale_positions(np.asarray(pose, np.float64), 1.0 / size)
            for pose in (shown.wrist, _present(frame, hand.prop))
        )
        mirrored = side == "left"
        if mirrored:
            wrist, obj = mirror_poses(wrist), mirror_poses(obj)
        local = take_snapshot(
            self._hand,
            self._shape(view),
            wrist,
            obj,
            mirrored,
            prop_scale / size,
            positions,
            rotations,
            hand.raw_positions,
            hand.distances,
        )

        def real(points: Array) -> Array:
            return size * (mirror_points(points) if mirrored else points)

        return Senses(
            np.asarray(shown.wrist, np.float64),
            real(self._hand.sensors.grid_center + CELL_OFFSETS_M),
            local.ambient,
            real(local.points),
            real(local.normals) / size,
            local.readings * size,
            real(hand.raw_positions),
            real(local.targets),
        )

    def _shape(self, view: ShapeView) -> Shape:
        if view.content_hash not in self._shapes:
            mesh = ClosedMesh(view.name, view.vertices, view.faces, view.content_hash)
            self._shapes[view.content_hash] = build_shape(mesh)
        return self._shapes[view.content_hash]


def _present(frame: Frame, name: str) -> Array:
    """The pose of a body at the tick."""
    return frame.windows[name][len(frame.windows[name]) // 2]
