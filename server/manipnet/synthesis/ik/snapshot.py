"""What one hand senses and aims for at one instant, for whoever wants to look at it (the live page)."""

from typing import NamedTuple

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import kernel, matrix, vector
from manipnet.synthesis.hand.skeleton import JOINT_COUNT
from manipnet.synthesis.ik.targets import place_targets
from manipnet.synthesis.objects.shape import Shape
from manipnet.synthesis.sensing.ambient import CELLS, sense_ambient
from manipnet.synthesis.sensing.proximity import (
    SENSOR_COUNT,
    SENSORS,
    aim_rays,
    allocate_rays,
    place_sensors,
    read_rays,
)
from manipnet.synthesis.sensing.scene import object_from_wrist


class SensorSnapshot(NamedTuple):
    """In the wrist frame of a right hand, metres."""

    ambient: np.ndarray
    """`(1000,)` occupancy of the grid's cells."""
    points: Array
    """`(104, 3)` proximity sensors."""
    normals: Array
    readings: np.ndarray
    """`(104,)` of the proximity sensors."""
    targets: Array
    """`(22, 3)` of inverse kinematics."""


def take_snapshot(
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
    """Of a hand posed by `positions (22, 3)` and `rotations (17, 3, 3)` at `wrist (7,)` beside a shape at `obj (7,)`;
    the network said `raw_positions (22, 3)` and `distances (22,)`. All as the network sees it: a right hand."""
    rays, readings = allocate_rays(SENSOR_COUNT + 1), np.empty((1, SENSOR_COUNT), np.float32)
    senses = SensorSnapshot(
        np.empty(CELLS**3, np.float32),
        np.empty((SENSOR_COUNT, 3)),
        np.empty((SENSOR_COUNT, 3)),
        readings[0],
        np.empty((JOINT_COUNT, 3)),
    )
    place = wrist, obj, mirrored, float(scale)
    traced = _present(SENSORS, shape.solid, *place, positions, rotations, raw_positions, distances, rays, senses)
    read_rays(shape.rays, rays, traced, np.array([scale], np.float64), readings)
    return senses


@kernel
def _present(sensors, solid, wrist, obj, mirrored, scale, positions, rotations, raw_positions, distances, rays, senses):
    rotation, translation = matrix(), vector()
    object_from_wrist(wrist, obj, mirrored, rotation, translation)
    sense_ambient(solid.field, rotation, translation, scale, senses.ambient)
    place_sensors(sensors, positions, rotations, senses.points, senses.normals)
    place_targets(solid, rotation, translation, scale, raw_positions, distances, senses.targets)
    points, normals, readings = senses.points, senses.normals, senses.readings
    return aim_rays(solid.bvh.boxes[0], rotation, translation, scale, points, normals, 0, readings, 0, rays, 0)
