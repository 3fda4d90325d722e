"""The sensors and inverse-kinematics targets of a hand at a tick, computed for display in the page's process.

The sensors are placed on the hand as it is shown. Those of the network were placed on its feedback pose, from the tick
before and without all of the last correction, and would be drawn up to a centimetre away from the fingers.
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
class SensorView:
    """Sensors of one hand in the frame of its wrist, metres."""

    wrist: Array
    """`(7,)` in the world."""
    cells: Array
    """`(1000, 3)` centres of the ambient sensor's cells."""
    ambient: np.ndarray
    """`(1000,)` occupancy of the cells, 0 to 1."""
    points: Array
    """`(S, 3)` positions of the proximity sensors."""
    normals: Array
    """`(S, 3)` directions of the proximity sensors."""
    readings: Array
    """`(S,)` distances to the surface that they read."""
    raw: Array
    """`(J, 3)` joints before inverse kinematics."""
    targets: Array
    """`(J, 3)` targets of inverse kinematics."""


class SensorViews:
    """Computes sensor views. Each shape is built, or read from the cache, once while a prop of the frame has it."""

    def __init__(self, hand: Hand) -> None:
        self._hand = hand
        self._shapes: dict[str, Shape] = {}

    def view(self, frame: Frame, side: Side, shape: ShapeView, prop_scale: float) -> SensorView:
        """The sensors of one hand, beside the shape of its prop."""
        hand, shown = frame.hands[side], frame.message.hands[side]
        used = {prop.content_hash for prop in frame.props}
        self._shapes = {name: built for name, built in self._shapes.items() if name in used}
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
            self._built(shape),
            wrist,
            obj,
            mirrored,
            prop_scale / size,
            positions,
            rotations,
            hand.raw_positions,
            hand.distances,
        )

        def actual(points: Array) -> Array:
            return size * (mirror_points(points) if mirrored else points)

        return SensorView(
            np.asarray(shown.wrist, np.float64),
            actual(self._hand.sensors.grid_center + CELL_OFFSETS_M),
            local.ambient,
            actual(local.points),
            actual(local.normals) / size,
            local.readings * size,
            actual(hand.raw_positions),
            actual(local.targets),
        )

    def _built(self, shape: ShapeView) -> Shape:
        if shape.content_hash not in self._shapes:
            mesh = ClosedMesh(shape.name, shape.vertices, shape.faces, shape.content_hash)
            self._shapes[shape.content_hash] = build_shape(mesh)
        return self._shapes[shape.content_hash]


def _present(frame: Frame, name: str) -> Array:
    """The pose of a body at the tick."""
    return frame.windows[name][len(frame.windows[name]) // 2]
