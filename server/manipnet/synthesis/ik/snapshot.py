"""What one hand senses and aims for at one instant, for display on the live page."""

from typing import NamedTuple

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import kernel, matrix, vector
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.packed import unpack_sensors
from manipnet.synthesis.ik.targets import place_targets
from manipnet.synthesis.model.layout import AMBIENT_CELLS
from manipnet.synthesis.objects.shape import Shape, Solid
from manipnet.synthesis.sensing.ambient import sense_ambient
from manipnet.synthesis.sensing.proximity import Rays, aim_rays, allocate_rays, place_sensors, read_rays
from manipnet.synthesis.sensing.scene import object_from_wrist


class SensorSnapshot(NamedTuple):
    """Readings in the wrist frame of a right hand, metres."""

    ambient: np.ndarray
    """`(1000,)` occupancy of the grid's cells."""
    points: Array
    """`(S, 3)` proximity sensors."""
    normals: Array
    readings: np.ndarray
    """`(S,)` of the proximity sensors."""
    targets: Array
    """`(J, 3)` of inverse kinematics."""


def take_snapshot(
    hand: Hand,
    shape: Shape,
    wrist: Array,
    obj: Array,
    mirrored: bool,
    scale: float,
    positions: Array,
    rotations: Array,
    raw_positions: Array,
    distances: Array,
) -> SensorSnapshot:
    """Sense with a hand at `wrist (7,)` beside a shape at `obj (7,)`, both as the network sees them: a right hand.

    The hand's pose is `positions (J, 3)` and `rotations (B, 3, 3)`; the network predicted `raw_positions (J, 3)` and
    `distances (J,)`.
    """
    count = hand.sensor_count
    rays, readings = allocate_rays(count + 1), np.empty((1, count), np.float32)
    snapshot = SensorSnapshot(
        np.empty(AMBIENT_CELLS**3, np.float32),
        np.empty((count, 3)),
        np.empty((count, 3)),
        readings[0],
        np.empty((hand.joint_count, 3)),
    )
    place = wrist, obj, mirrored, float(scale)
    traced = _sense(hand.packed, shape.solid, *place, positions, rotations, raw_positions, distances, rays, snapshot)
    read_rays(shape.rays, rays, traced, np.array([scale], np.float64), readings)
    return snapshot


@kernel
def _sense(
    hand: np.ndarray,
    solid: Solid,
    wrist: Array,
    obj: Array,
    mirrored: bool,
    scale: float,
    positions: Array,
    rotations: Array,
    raw_positions: Array,
    distances: Array,
    rays: Rays,
    snapshot: SensorSnapshot,
):
    sensors, rotation, translation = unpack_sensors(hand), matrix(), vector()
    count = len(sensors.bones)
    object_from_wrist(wrist, obj, mirrored, rotation, translation)
    sense_ambient(solid.field, sensors.grid_center, rotation, translation, scale, snapshot.ambient)
    place_sensors(sensors, positions, rotations, snapshot.points, snapshot.normals)
    place_targets(solid, rotation, translation, scale, raw_positions, distances, snapshot.targets)
    points, normals, readings = snapshot.points, snapshot.normals, snapshot.readings
    return aim_rays(solid.bvh.boxes[0], rotation, translation, scale, points, normals, count, 0, readings, 0, rays, 0)
