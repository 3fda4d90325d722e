"""Features of one tick: the network's 2356 inputs for any number of hands, the same in training and live.

Hands come as arrays in the scene the network sees, in which every hand is a right hand: a left hand's window is
mirrored before (`mirrored` says so, because then the object's own geometry must be mirrored too).
"""

from typing import NamedTuple

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, kernel, matrix, stack_array, vector
from manipnet.synthesis.model.layout import (
    INPUT,
    INPUT_SIZE,
    OUTPUT,
    OUTPUT_DISTANCE_MAX_M,
    OUTPUT_SIZE,
    PRESENT,
    SENSED,
    WINDOW_STEP_S,
)
from manipnet.synthesis.objects.shape import Shape
from manipnet.synthesis.sensing.ambient import sense_ambient
from manipnet.synthesis.sensing.distance import sense_distances
from manipnet.synthesis.sensing.proximity import (
    SENSOR_COUNT,
    SENSORS,
    Rays,
    aim_rays,
    allocate_rays,
    place_sensors,
    read_rays,
)
from manipnet.synthesis.sensing.scene import object_from_wrist, quat_to_matrix_into

_POSITIONS, _AXES = INPUT["joint_positions"].start, INPUT["joint_axes"].start
_WRIST_POSITIONS, _WRIST_AXES = INPUT["wrist_positions"].start, INPUT["wrist_axes"].start
_OTHER, _CENTERS = INPUT["other_wrist_distances"].start, INPUT["object_centers"].start
_SPINS, _AMBIENT = INPUT["object_angular_velocities"].start, INPUT["ambient"].start
_PROXIMITY = INPUT["proximity"].start
_DISTANCES, _NORMALS = INPUT["signed_distances"].start, INPUT["surface_normals"].start
_OUT_AXES, _OUT_DISTANCES = OUTPUT["joint_axes"].start, OUTPUT["distances"].start
_WINDOW, _SENSED_COUNT = 21, len(SENSED)
_joint_numbers, _joint_vectors, _sensor_vectors = stack_array(22), stack_array(22, 3), stack_array(SENSOR_COUNT, 3)


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


RAYS_PER_HAND = _SENSED_COUNT * SENSOR_COUNT


def features(shape: Shape, windows: Windows, positions: Array, rotations: Array) -> np.ndarray:
    """Network inputs `(N, 2356)` float32 of hands that all face `shape`.

    `positions (N, 22, 3)` and `rotations (N, 17, 3, 3)` are the present poses in the wrist frame.
    """
    count = len(positions)
    rows = np.empty((count, INPUT_SIZE), np.float32)
    sense(shape, windows, positions, rotations, 0, count, allocate_rays(count * RAYS_PER_HAND + 1), rows)
    return rows


def sense(
    shape: Shape,
    windows: Windows,
    positions: Array,
    rotations: Array,
    first: int,
    last: int,
    rays: Rays,
    rows: np.ndarray,
) -> None:
    """Features of the hands `first … last - 1`, which all face `shape`, into those `rows (N, 2356)` of `N` hands.

    `rays` is room for one ray more than `RAYS_PER_HAND` of each of them.
    """
    traced = _all_but_readings(SENSORS, shape.solid, windows, positions, rotations, first, last, rays, rows)
    read_rays(shape.rays, rays, traced, windows.scale, rows)


def pose_outputs(positions: Array, rotations: Array, distances: Array) -> np.ndarray:
    """Network outputs `(N, 220)` float32 that say a pose and its signed joint distances `(N, 22)`."""
    rows = np.empty((len(positions), OUTPUT_SIZE), np.float32)
    _all_pose_rows(positions, rotations, rows)
    rows[:, OUTPUT["distances"].columns] = np.clip(distances, 0.0, OUTPUT_DISTANCE_MAX_M)
    return rows


def joint_distances(shape: Shape, windows: Windows, positions: Array) -> Array:
    """Signed distances `(N, 22)` of joints at the present tick, metres, clamped at +10 cm."""
    distances = np.empty((len(positions), 22))
    _present_distances(shape.solid, windows, positions, distances)
    return distances


@kernel
def _present_distances(solid, windows, positions, distances):
    rotation, translation, normals = matrix(), vector(), _joint_vectors()
    for n in range(len(positions)):
        object_from_wrist(
            windows.wrist[n, PRESENT], windows.object[n, PRESENT], windows.mirrored[n], rotation, translation
        )
        sense_distances(solid, np.inf, rotation, translation, windows.scale[n], positions[n], distances[n], normals)


@inner
def _pose_rows(positions, rotations, first, last, rows):
    """Joint positions and the first two axes of every bone, tips carrying their parent's."""
    for n in range(first, last):
        for j in range(22):
            # the tips follow joints 4, 7, 10, 13, 16
            bone = j if j < 17 else 3 * (j - 17) + 4
            for i in range(3):
                rows[n, 3 * j + i] = positions[n, j, i]
                rows[n, _OUT_AXES + 6 * j + i] = rotations[n, bone, i, 0]
                rows[n, _OUT_AXES + 6 * j + 3 + i] = rotations[n, bone, i, 1]


@kernel
def _all_pose_rows(positions, rotations, rows):
    _pose_rows(positions, rotations, 0, len(rows), rows)


@inner
def _rotation_vector_into(m, out):
    """Logarithm of a rotation matrix by way of its quaternion's vector part; exact for the small turns of a window."""
    x, y, z = 0.5 * (m[2, 1] - m[1, 2]), 0.5 * (m[0, 2] - m[2, 0]), 0.5 * (m[1, 0] - m[0, 1])
    sine = np.sqrt(x * x + y * y + z * z)
    angle = np.arctan2(sine, 0.5 * (m[0, 0] + m[1, 1] + m[2, 2] - 1.0))
    factor = 1.0 if sine < 1e-9 else angle / sine
    out[0], out[1], out[2] = factor * x, factor * y, factor * z


@inner
def _trajectory_row(wrist, other, obj, mirrored, scale, center_of_mass, row):
    w0, w, o, before, turn, spin, center = matrix(), matrix(), matrix(), matrix(), matrix(), vector(), vector()
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


@kernel
def _all_but_readings(sensors, solid, windows, positions, rotations, first, last, rays, rows):
    """Every block of some rows but the readings of rays that have to be traced; returns how many these are."""
    rotation, translation = matrix(), vector()
    points, directions = _sensor_vectors(), _sensor_vectors()
    distances, normals = _joint_numbers(), _joint_vectors()
    box, traced = solid.bvh.boxes[0], 0
    _pose_rows(positions, rotations, first, last, rows)
    for n in range(first, last):
        row, mirrored, scale = rows[n], windows.mirrored[n], windows.scale[n]
        wrist, obj = windows.wrist[n], windows.object[n]
        _trajectory_row(wrist, windows.other_wrist[n], obj, mirrored, scale, solid.center_of_mass, row)
        place_sensors(sensors, positions[n], rotations[n], points, directions)
        for s in range(_SENSED_COUNT):
            t = SENSED[s]
            object_from_wrist(wrist[t], obj[t], mirrored, rotation, translation)
            column = _PROXIMITY + SENSOR_COUNT * s
            traced = aim_rays(box, rotation, translation, scale, points, directions, n, row, column, rays, traced)
            sense_distances(solid, solid.exact_within_m, rotation, translation, scale, positions[n], distances, normals)
            for j in range(22):
                row[_DISTANCES + 22 * s + j] = distances[j]
            if s == 0:
                sense_ambient(solid.field, rotation, translation, scale, row[_AMBIENT : _AMBIENT + 1000])
                for j in range(22):
                    for i in range(3):
                        row[_NORMALS + 3 * j + i] = normals[j, i]
    return traced
