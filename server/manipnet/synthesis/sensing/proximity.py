"""Proximity sensors: rays from points on the palm side of the skin (paper, section 5.2)."""

from typing import NamedTuple

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, kernel
from manipnet.synthesis.hand.hand import Sensors
from manipnet.synthesis.objects.rays import RayScene
from manipnet.synthesis.sensing.scene import SENSOR_RANGE_M

_ROUNDING_M = 1e-5
"""Rays are traced in single precision: one that passes a box this near may touch what fills it."""


class Rays(NamedTuple):
    """Memory for `N` rays in the coordinates of the object they are traced against."""

    origins: np.ndarray
    """`(N, 3)` float32."""
    directions: np.ndarray
    """`(N, 3)` float32, unit."""
    places: np.ndarray
    """`(N, 2)` int32: row and column of each ray's reading among the features."""


def allocate_rays(count: int) -> Rays:
    """Memory for `count` rays."""
    return Rays(np.empty((count, 3), np.float32), np.empty((count, 3), np.float32), np.empty((count, 2), np.int32))


@inner
def place_sensors(sensors: Sensors, positions: Array, rotations: Array, points: Array, normals: Array):
    """Skin the sensors to the pose `positions (J, 3)`, `rotations (B, 3, 3)`, into `points` and `normals (S, 3)`."""
    for s in range(len(sensors.bones)):
        for i in range(3):
            points[s, i] = normals[s, i] = 0.0
        for k in range(sensors.bones.shape[1]):
            weight, bone = sensors.weights[s, k], sensors.bones[s, k]
            if weight == 0.0:
                continue
            for i in range(3):
                p, n = positions[bone, i], 0.0
                for j in range(3):
                    p += rotations[bone, i, j] * sensors.points[s, k, j]
                    n += rotations[bone, i, j] * sensors.normals[s, k, j]
                points[s, i] += weight * p
                normals[s, i] += weight * n
        length = np.sqrt(normals[s, 0] ** 2 + normals[s, 1] ** 2 + normals[s, 2] ** 2)
        for i in range(3):
            normals[s, i] /= length


@inner
def aim_rays(
    box: Array,
    rotation: Array,
    translation: Array,
    scale: float,
    points: Array,
    normals: Array,
    sensors: int,
    row: int,
    readings: np.ndarray,
    first_column: int,
    rays: Rays,
    count: int,
):
    """Carry the first `sensors` points of one instant into the object's coordinates, as rays from number `count` on;
    returns the new count.

    A ray that cannot reach the object's `box (6,)` reads its full range: that is written into `readings` from
    `first_column` on, and the ray is left out. The others are stored with their `row` and column.
    """
    reach, size = SENSOR_RANGE_M / scale, 1.0 / scale
    for s in range(sensors):
        column = first_column + s
        readings[column] = SENSOR_RANGE_M
        enter, leave = 0.0, reach
        for i in range(3):
            p, d = translation[i], 0.0
            for j in range(3):
                p += rotation[i, j] * points[s, j]
                d += rotation[i, j] * normals[s, j]
            p *= size
            rays.origins[count, i], rays.directions[count, i] = p, d
            below, above = box[i] - _ROUNDING_M - p, box[3 + i] + _ROUNDING_M - p
            if abs(d) < 1e-9:
                if below > 0.0 or above < 0.0:
                    leave = -1.0
            else:
                per_m = 1.0 / d
                near, far = below * per_m, above * per_m
                enter, leave = max(enter, min(near, far)), min(leave, max(near, far))
        if enter <= leave:
            rays.places[count, 0], rays.places[count, 1] = row, column
            count += 1
    return count


def read_rays(scene: RayScene, rays: Rays, count: int, scale: Array, rows: np.ndarray) -> None:
    """Trace the first `count` rays and put their readings, metres, into the features `rows (N, input_size)`.

    `scale (N,)` is the object's. A reading is positive outside, at most +10 cm. A first hit on a surface that faces
    away means that the sensor is inside: its ray is reversed and the reading is negative, at least -10 cm.
    """
    if count == 0:
        return
    distance, inside = scene.trace(rays.origins[:count], rays.directions[:count])
    buried = _put_readings(distance, inside, rays, scale, rows)
    if buried:
        depth, _ = scene.trace(rays.origins[:buried], rays.directions[:buried])
        _put_depths(depth, rays, scale, rows)


@kernel
def _put_readings(distance: np.ndarray, inside: np.ndarray, rays: Rays, scale: Array, rows: np.ndarray):
    """Write what the rays read, reverse those that began inside, and return how many these are."""
    buried = 0
    for k in range(len(distance)):
        row, column = rays.places[k, 0], rays.places[k, 1]
        rows[row, column] = min(distance[k] * scale[row], SENSOR_RANGE_M)
        if inside[k]:
            for i in range(3):
                rays.origins[buried, i] = rays.origins[k, i]
                rays.directions[buried, i] = -rays.directions[k, i]
            rays.places[buried, 0], rays.places[buried, 1] = row, column
            buried += 1
    return buried


@kernel
def _put_depths(depth: np.ndarray, rays: Rays, scale: Array, rows: np.ndarray):
    for k in range(len(depth)):
        row, column = rays.places[k, 0], rays.places[k, 1]
        rows[row, column] = -min(depth[k] * scale[row], SENSOR_RANGE_M)
