"""Features of one tick: the network's inputs for any number of hands, the same in training and live.

Hands come as arrays in the scene that the network sees, in which every hand is a right hand. A left hand's window is
mirrored before; `mirrored` says so, because the object's own geometry must then be mirrored too.
"""

from typing import NamedTuple

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, kernel, matrix, stack_array, vector
from manipnet.synthesis.hand.hand import MAX_JOINTS, MAX_SENSORS, Hand, Indices
from manipnet.synthesis.hand.packed import unpack_sensors, unpack_skeleton
from manipnet.synthesis.model.layout import (
    AMBIENT_CELLS,
    OUTPUT_DISTANCE_MAX_M,
    PRESENT,
    SENSED,
    WINDOW,
    WINDOW_STEP_S,
    InputColumns,
    Layout,
    layout_of,
)
from manipnet.synthesis.objects.shape import Shape, Solid
from manipnet.synthesis.rotations import quat_to_matrix_into, rotation_vector_into
from manipnet.synthesis.sensing.ambient import sense_ambient
from manipnet.synthesis.sensing.distance import sense_distances
from manipnet.synthesis.sensing.proximity import Rays, aim_rays, allocate_rays, place_sensors, read_rays
from manipnet.synthesis.sensing.scene import object_from_wrist

_SENSED_COUNT = len(SENSED)
_joint_numbers, _joint_vectors = stack_array(MAX_JOINTS), stack_array(MAX_JOINTS, 3)
_sensor_vectors = stack_array(MAX_SENSORS, 3)


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


def rays_of(hand: Hand, count: int) -> Rays:
    """Memory for the rays of `count` hands: all their sensors' at every instant that is sensed, and one more."""
    return allocate_rays(count * _SENSED_COUNT * hand.sensor_count + 1)


def features(hand: Hand, shape: Shape, windows: Windows, positions: Array, rotations: Array) -> np.ndarray:
    """Network inputs `(N, input_size)` float32 of hands that all face `shape`.

    `positions (N, J, 3)` and `rotations (N, B, 3, 3)` are the present poses in the wrist frame.
    """
    count, layout = len(positions), layout_of(hand)
    rows = np.empty((count, layout.input_size), np.float32)
    sense(hand, layout, shape, windows, positions, rotations, 0, count, rays_of(hand, count), rows)
    return rows


def sense(
    hand: Hand,
    layout: Layout,
    shape: Shape,
    windows: Windows,
    positions: Array,
    rotations: Array,
    first: int,
    last: int,
    rays: Rays,
    rows: np.ndarray,
) -> None:
    """Features of the hands `first … last - 1`, which all face `shape`, into those `rows (N, input_size)`.

    `rays` has room for all of them (`rays_of`).
    """
    traced = _all_but_readings(
        hand.packed,
        layout.input_starts,
        shape.solid,
        windows,
        positions,
        rotations,
        first,
        last,
        rays,
        rows,
    )
    read_rays(shape.rays, rays, traced, windows.scale, rows)


def pose_outputs(hand: Hand, positions: Array, rotations: Array, distances: Array) -> np.ndarray:
    """Network outputs `(N, output_size)` float32 that mean a pose and its signed joint distances `(N, J)`."""
    layout = layout_of(hand)
    rows = np.empty((len(positions), layout.output_size), np.float32)
    _all_pose_rows(hand.parents, layout.output["joint_axes"].start, positions, rotations, rows)
    rows[:, layout.output["distances"].columns] = np.clip(distances, 0.0, OUTPUT_DISTANCE_MAX_M)
    return rows


def joint_distances(shape: Shape, windows: Windows, positions: Array) -> Array:
    """Signed distances `(N, J)` of joints at the present tick, metres, clamped at +10 cm."""
    distances = np.empty(positions.shape[:2])
    _present_distances(shape.solid, windows, positions, distances)
    return distances


@kernel
def _present_distances(solid: Solid, windows: Windows, positions: Array, distances: Array):
    rotation, translation, normals = matrix(), vector(), _joint_vectors()
    for n in range(len(positions)):
        object_from_wrist(
            windows.wrist[n, PRESENT], windows.object[n, PRESENT], windows.mirrored[n], rotation, translation
        )
        sense_distances(solid, np.inf, rotation, translation, windows.scale[n], positions[n], distances[n], normals)


@inner
def _pose_rows(
    parents: Indices, axes_column: int, positions: Array, rotations: Array, first: int, last: int, rows: np.ndarray
):
    """Joint positions and the first two axes of every bone; tips carry their parent's."""
    bones = rotations.shape[1]
    for n in range(first, last):
        for j in range(len(parents)):
            bone = j if j < bones else parents[j]
            for i in range(3):
                rows[n, 3 * j + i] = positions[n, j, i]
                rows[n, axes_column + 6 * j + i] = rotations[n, bone, i, 0]
                rows[n, axes_column + 6 * j + 3 + i] = rotations[n, bone, i, 1]


@kernel
def _all_pose_rows(parents: Indices, axes_column: int, positions: Array, rotations: Array, rows: np.ndarray):
    _pose_rows(parents, axes_column, positions, rotations, 0, len(rows), rows)


@inner
def _unpack_columns(starts: Indices):
    """The first columns of the input blocks, from `Layout.input_starts`."""
    s = starts
    return InputColumns(s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7], s[8], s[9], s[10])


@inner
def _trajectory_row(
    columns: InputColumns,
    wrist: Array,
    other: Array,
    obj: Array,
    mirrored: bool,
    scale: float,
    center_of_mass: Array,
    row: np.ndarray,
):
    w0, w, o, before, turn, spin, center = matrix(), matrix(), matrix(), matrix(), matrix(), vector(), vector()
    quat_to_matrix_into(wrist[PRESENT, 3:], w0)
    origin = wrist[PRESENT]
    for t in range(WINDOW):
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
            rotation_vector_into(turn, spin)
        apart = 0.0
        for i in range(3):
            p = c = v = x = y = 0.0
            for k in range(3):
                p += w0[k, i] * (wrist[t, k] - origin[k])
                c += w0[k, i] * (center[k] - origin[k])
                v += w0[k, i] * spin[k]
                x += w0[k, i] * w[k, 0]
                y += w0[k, i] * w[k, 1]
            row[columns.wrist_positions + 3 * t + i] = p
            row[columns.wrist_axes + 6 * t + i] = x
            row[columns.wrist_axes + 6 * t + 3 + i] = y
            row[columns.object_centers + 3 * t + i] = c
            apart += (other[t, i] - origin[i]) ** 2
            if t > 0:
                row[columns.object_angular_velocities + 3 * t + i] = v / WINDOW_STEP_S
            if t == 1:
                row[columns.object_angular_velocities + i] = v / WINDOW_STEP_S
        row[columns.other_wrist_distances + t] = np.sqrt(apart)


@kernel
def _all_but_readings(
    hand: np.ndarray,
    starts: Indices,
    solid: Solid,
    windows: Windows,
    positions: Array,
    rotations: Array,
    first: int,
    last: int,
    rays: Rays,
    rows: np.ndarray,
):
    """Every block of some rows except the readings of rays that must be traced; returns how many these are."""
    skeleton, sensors, columns = unpack_skeleton(hand), unpack_sensors(hand), _unpack_columns(starts)
    rotation, translation = matrix(), vector()
    points, directions = _sensor_vectors(), _sensor_vectors()
    distances, normals = _joint_numbers(), _joint_vectors()
    box, traced = solid.bvh.boxes[0], 0
    joints, count = len(skeleton.parents), len(sensors.bones)
    _pose_rows(skeleton.parents, columns.joint_axes, positions, rotations, first, last, rows)
    for n in range(first, last):
        row, mirrored, scale = rows[n], windows.mirrored[n], windows.scale[n]
        wrist, obj = windows.wrist[n], windows.object[n]
        _trajectory_row(columns, wrist, windows.other_wrist[n], obj, mirrored, scale, solid.center_of_mass, row)
        place_sensors(sensors, positions[n], rotations[n], points, directions)
        for s in range(_SENSED_COUNT):
            t = SENSED[s]
            object_from_wrist(wrist[t], obj[t], mirrored, rotation, translation)
            column = columns.proximity + count * s
            traced = aim_rays(
                box, rotation, translation, scale, points, directions, count, n, row, column, rays, traced
            )
            sense_distances(solid, solid.exact_within_m, rotation, translation, scale, positions[n], distances, normals)
            for j in range(joints):
                row[columns.signed_distances + joints * s + j] = distances[j]
            if s == 0:
                occupancies = row[columns.ambient : columns.ambient + AMBIENT_CELLS**3]
                sense_ambient(solid.field, sensors.grid_center, rotation, translation, scale, occupancies)
                for j in range(joints):
                    for i in range(3):
                        row[columns.surface_normals + 3 * j + i] = normals[j, i]
    return traced
