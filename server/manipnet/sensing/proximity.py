"""Proximity sensors: rays off 104 points of the palm side (paper, section 5.2)."""

from typing import NamedTuple

import numpy as np

from manipnet.geometry import Array
from manipnet.hand.surface import SENSOR_BONES, SENSOR_NORMALS, SENSOR_POINTS, SENSOR_WEIGHTS
from manipnet.kernels import njit
from manipnet.objects.rays import RayScene
from manipnet.sensing.scene import SENSOR_RANGE_M

SENSOR_COUNT = len(SENSOR_BONES)


class Sensors(NamedTuple):
    """Points of the skin with the bones they follow: an argument of the kernels, because compiled code is cached by
    its own file and would not notice another surface."""

    bones: np.ndarray
    weights: Array
    points: Array
    normals: Array


SENSORS = Sensors(SENSOR_BONES, SENSOR_WEIGHTS, SENSOR_POINTS, SENSOR_NORMALS)


@njit(cache=True, nogil=True)
def place_sensors(sensors, positions, rotations, points, normals):
    """Skin the sensors to a pose: `positions (22, 3)`, `rotations (17, 3, 3)` into `points`, `normals (104, 3)`."""
    for s in range(SENSOR_COUNT):
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


@njit(cache=True, nogil=True)
def aim_rays(rotation, translation, scale, points, normals, origins, directions):
    """Carry the sensors into the object's coordinates as float32 rays `(104, 3)`."""
    for s in range(SENSOR_COUNT):
        for i in range(3):
            p, d = translation[i], 0.0
            for j in range(3):
                p += rotation[i, j] * points[s, j]
                d += rotation[i, j] * normals[s, j]
            origins[s, i], directions[s, i] = p / scale, d


def proximity(rays: RayScene, origins: np.ndarray, directions: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Readings `(N,)` in metres of rays `(N, 3)` in object coordinates, at `scale` `(N,)` of the object.

    Positive outside, at most +10 cm. A first hit on a surface that faces away means the sensor is inside: the ray is
    reversed and the reading negative, at least -10 cm.
    """
    distance, inside = rays.trace(origins, directions)
    reading = np.minimum(distance * scale, SENSOR_RANGE_M)
    buried = np.flatnonzero(inside)
    if len(buried):
        depth, _ = rays.trace(origins[buried], -directions[buried])
        reading[buried] = -np.minimum(depth * scale[buried], SENSOR_RANGE_M)
    return reading
