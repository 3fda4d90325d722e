"""Features of one tick: the network's 2356 inputs for any number of hands, the same in training and live.

Hands come as arrays in the scene the network sees, in which every hand is a right hand: a left hand's window is
mirrored before (`mirrored` says so, because then the object's own geometry must be mirrored too).
"""

from typing import NamedTuple

import numpy as np

from manipnet.geometry import Array
from manipnet.kernels import njit
from manipnet.network.layout import (
    INPUT,
    INPUT_SIZE,
    OUTPUT,
    OUTPUT_DISTANCE_MAX_M,
    OUTPUT_SIZE,
    PRESENT,
    SENSED,
    WINDOW_STEP_S,
)
from manipnet.objects.shape import Shape
from manipnet.sensing.ambient import sense_ambient
from manipnet.sensing.distance import sense_distances
from manipnet.sensing.proximity import SENSOR_COUNT, SENSORS, aim_rays, place_sensors, proximity
from manipnet.sensing.scene import object_from_wrist, quat_to_matrix_into

_POSITIONS, _AXES = INPUT["joint_positions"].start, INPUT["joint_axes"].start
_WRIST_POSITIONS, _WRIST_AXES = INPUT["wrist_positions"].start, INPUT["wrist_axes"].start
_OTHER, _CENTERS = INPUT["other_wrist_distances"].start, INPUT["object_centers"].start
_SPINS, _AMBIENT = INPUT["object_angular_velocities"].start, INPUT["ambient"].start
_DISTANCES, _NORMALS = INPUT["signed_distances"].start, INPUT["surface_normals"].start
_OUT_AXES, _OUT_DISTANCES = OUTPUT["joint_axes"].start, OUTPUT["distances"].start
_WINDOW, _SENSED_COUNT = 21, len(SENSED)


class Windows(NamedTuple):
    """Trajectories of `N` hands about the present tick, world frame, left hands already mirrored."""

    wrist: Array
    """`(N, 21, 7)` poses."""
    other_wrist: Array
    """`(N, 21, 3)` positions of the other wrist."""
    object: Array
    """`(N, 21, 7)` poses of the object."""
    mirrored: np.ndarray
    """`(N,)` bool."""
    scale: Array
    """`(N,)` scale of the object."""


def features(shape: Shape, windows: Windows, positions: Array, rotations: Array) -> np.ndarray:
    """Network inputs `(N, 2356)` float32 of hands that all face `shape`.

    `positions (N, 22, 3)` and `rotations (N, 17, 3, 3)` are the present poses in the wrist frame.
    """
    count = len(positions)
    rows = np.empty((count, INPUT_SIZE), np.float32)
    rays = np.empty((2, count, _SENSED_COUNT, SENSOR_COUNT, 3), np.float32)
    _features_without_rays(
        SENSORS,
        shape.bvh,
        shape.field,
        shape.exact_within_m,
        shape.center_of_mass,
        windows,
        positions,
        rotations,
        rows,
        rays,
    )
    scale = np.repeat(windows.scale, _SENSED_COUNT * SENSOR_COUNT)
    readings = proximity(shape.rays, rays[0].reshape(-1, 3), rays[1].reshape(-1, 3), scale)
    rows[:, INPUT["proximity"].columns] = readings.reshape(count, -1)
    return rows


def pose_outputs(positions: Array, rotations: Array, distances: Array) -> np.ndarray:
    """Network outputs `(N, 220)` float32 that say a pose and its signed joint distances `(N, 22)`."""
    rows = np.empty((len(positions), OUTPUT_SIZE), np.float32)
    _pose_rows(positions, rotations, rows)
    rows[:, OUTPUT["distances"].columns] = np.clip(distances, 0.0, OUTPUT_DISTANCE_MAX_M)
    return rows


def joint_distances(shape: Shape, windows: Windows, positions: Array) -> Array:
    """Signed distances `(N, 22)` of joints at the present tick, metres, clamped at +10 cm."""
    distances, normals = np.empty((len(positions), 22)), np.empty((22, 3))
    _present_distances(shape.bvh, shape.field, windows, positions, distances, normals)
    return distances


@njit(cache=True, nogil=True)
def _present_distances(bvh, field, windows, positions, distances, normals):
    rotation, translation = np.empty((3, 3)), np.empty(3)
    for n in range(len(positions)):
        object_from_wrist(
            windows.wrist[n, PRESENT], windows.object[n, PRESENT], windows.mirrored[n], rotation, translation
        )
        sense_distances(
            bvh, field, rotation, translation, windows.scale[n], np.inf, positions[n], distances[n], normals
        )


@njit(cache=True, nogil=True)
def _pose_rows(positions, rotations, rows):
    """Joint positions and the first two axes of every bone, tips carrying their parent's."""
    for n in range(len(positions)):
        for j in range(22):
            # the tips follow joints 4, 7, 10, 13, 16
            bone = j if j < 17 else 3 * (j - 17) + 4
            for i in range(3):
                rows[n, 3 * j + i] = positions[n, j, i]
                rows[n, _OUT_AXES + 6 * j + i] = rotations[n, bone, i, 0]
                rows[n, _OUT_AXES + 6 * j + 3 + i] = rotations[n, bone, i, 1]


@njit(cache=True, nogil=True)
def _rotation_vector_into(m, out):
    """Logarithm of a rotation matrix by way of its quaternion's vector part; exact for the small turns of a window."""
    x, y, z = 0.5 * (m[2, 1] - m[1, 2]), 0.5 * (m[0, 2] - m[2, 0]), 0.5 * (m[1, 0] - m[0, 1])
    sine = np.sqrt(x * x + y * y + z * z)
    angle = np.arctan2(sine, 0.5 * (m[0, 0] + m[1, 1] + m[2, 2] - 1.0))
    factor = 1.0 if sine < 1e-9 else angle / sine
    out[0], out[1], out[2] = factor * x, factor * y, factor * z


@njit(cache=True, nogil=True)
def _trajectory_row(wrist, other, obj, mirrored, scale, center_of_mass, row):
    w0, w, o = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    before, turn, spin, center = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty(3)
    quat_to_matrix_into(wrist[PRESENT, 3:], w0)
    origin = wrist[PRESENT]
    for t in range(_WINDOW):
        quat_to_matrix_into(wrist[t, 3:], w)
        for i in range(3):
            for j in range(3):
                before[i, j] = o[i, j]
        quat_to_matrix_into(obj[t, 3:], o)
        for i in range(3):
            center[i] = 0.0
            for j in range(3):
                flip = -1.0 if mirrored and j == 0 else 1.0
                center[i] += o[i, j] * flip * center_of_mass[j] * scale
            center[i] += obj[t, i]
        if t > 0:
            for i in range(3):
                for j in range(3):
                    turn[i, j] = o[i, 0] * before[j, 0] + o[i, 1] * before[j, 1] + o[i, 2] * before[j, 2]
            _rotation_vector_into(turn, spin)
        apart = 0.0
        for i in range(3):
            p = c = v = x = y = 0.0
            for k in range(3):
                p += w0[k, i] * (wrist[t, k] - origin[k])
                c += w0[k, i] * (center[k] - origin[k])
                v += w0[k, i] * spin[k]
                x += w0[k, i] * w[k, 0]
                y += w0[k, i] * w[k, 1]
            row[_WRIST_POSITIONS + 3 * t + i] = p
            row[_WRIST_AXES + 6 * t + i] = x
            row[_WRIST_AXES + 6 * t + 3 + i] = y
            row[_CENTERS + 3 * t + i] = c
            apart += (other[t, i] - origin[i]) ** 2
            if t > 0:
                row[_SPINS + 3 * t + i] = v / WINDOW_STEP_S
            if t == 1:
                row[_SPINS + i] = v / WINDOW_STEP_S
        row[_OTHER + t] = np.sqrt(apart)


@njit(cache=True, nogil=True)
def _features_without_rays(
    sensors, bvh, field, exact_within_m, center_of_mass, windows, positions, rotations, rows, rays
):
    rotation, translation = np.empty((3, 3)), np.empty(3)
    points, directions = np.empty((SENSOR_COUNT, 3)), np.empty((SENSOR_COUNT, 3))
    distances, normals = np.empty(22), np.empty((22, 3))
    _pose_rows(positions, rotations, rows)
    for n in range(len(positions)):
        row, scale = rows[n], windows.scale[n]
        _trajectory_row(
            windows.wrist[n],
            windows.other_wrist[n],
            windows.object[n],
            windows.mirrored[n],
            scale,
            center_of_mass,
            row,
        )
        place_sensors(sensors, positions[n], rotations[n], points, directions)
        for s in range(_SENSED_COUNT):
            t = SENSED[s]
            object_from_wrist(windows.wrist[n, t], windows.object[n, t], windows.mirrored[n], rotation, translation)
            aim_rays(rotation, translation, scale, points, directions, rays[0, n, s], rays[1, n, s])
            sense_distances(bvh, field, rotation, translation, scale, exact_within_m, positions[n], distances, normals)
            for j in range(22):
                row[_DISTANCES + 22 * s + j] = distances[j]
            if s == 0:
                sense_ambient(field, rotation, translation, scale, row[_AMBIENT : _AMBIENT + 1000])
                for j in range(22):
                    for i in range(3):
                        row[_NORMALS + 3 * j + i] = normals[j, i]
