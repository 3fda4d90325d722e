"""Builds `manipnet/synthesis/hand/surface.npz`: the hand's skin, how it follows the bones, and where its sensors sit.

python -m manipnet_tools.assets.hand_surface
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import manipnet.synthesis.hand
from manipnet.geometry import Array
from manipnet.synthesis.hand.bind_pose import BIND_ANGLES_RAD
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.hand.skeleton import BONE_COUNT, PARENTS
from manipnet_tools.assets.hand_sdf import HandShape, bind_shape, palmar_directions
from manipnet_tools.assets.surface_nets import extract, neighbour_mean, polish

CELL_M = 0.0037
POLISH_ROUNDS = 12
WEIGHT_FALLOFF_M = 0.004
WEIGHT_SMOOTHING = 3
BONES_PER_VERTEX = 4
SENSOR_COUNT = 104
SENSOR_BONES = 2
PALMAR_COSINE = 0.45
"""A vertex belongs to the palm side if its normal is within about 63 degrees of where flexion takes its bone."""


def build() -> dict[str, np.ndarray]:
    """All arrays of the data file."""
    shape = bind_shape()
    joints, rotations = forward_kinematics(BIND_ANGLES_RAD)
    low, high = joints.min(axis=0) - 0.05, joints.max(axis=0) + 0.05
    low[0] = -0.07
    vertices, faces = extract(shape.distance, low, high, CELL_M)
    vertices, normals = polish(shape.distance, vertices, faces, POLISH_ROUNDS)
    weights = skin_weights(shape, vertices, faces)
    bones, top = _strongest(weights, BONES_PER_VERTEX)
    sensors = choose_sensors(vertices, normals, weights, faces, palmar_directions(joints, rotations), joints)
    sensor_bones, sensor_weights = _strongest(weights[sensors], SENSOR_BONES)
    to_bone = np.swapaxes(rotations, 1, 2)[sensor_bones]
    relative = vertices[sensors][:, None] - joints[sensor_bones]
    return {
        "vertices": vertices.astype(np.float32),
        "faces": faces.astype(np.uint16),
        "bones": bones.astype(np.uint8),
        "weights": top.astype(np.float32),
        "sensor_bones": sensor_bones.astype(np.uint8),
        "sensor_weights": sensor_weights,
        "sensor_points": np.einsum("skij,skj->ski", to_bone, relative),
        "sensor_normals": np.einsum("skij,sj->ski", to_bone, normals[sensors]),
    }


def skin_weights(shape: HandShape, vertices: Array, faces: NDArray) -> Array:
    """Weights `(V, 17)` that sum to one: nearness to each bone's flesh, smoothed along the skin.

    A bone shares only with its parent and children, so that fingers never drag their neighbours along.
    """
    distance = shape.bone_distances(vertices)
    main = distance.argmin(axis=1)
    related = np.eye(BONE_COUNT, dtype=bool)
    for bone in range(1, BONE_COUNT):
        related[bone, PARENTS[bone]] = related[PARENTS[bone], bone] = True
    related[2, 0] = related[0, 2] = True  # bone 1 has no flesh of its own
    nearness = np.exp(-(distance - distance.min(axis=1, keepdims=True)) / WEIGHT_FALLOFF_M)
    weights = np.where(related[main], nearness, 0.0)
    for _ in range(WEIGHT_SMOOTHING):
        weights = 0.5 * weights + 0.5 * neighbour_mean(weights, faces)
    return weights / weights.sum(axis=1, keepdims=True)


def choose_sensors(
    vertices: Array, normals: Array, weights: Array, faces: NDArray, palmar: Array, joints: Array
) -> NDArray[np.int64]:
    """Vertices of the palm side, spread evenly by farthest-point sampling from the middle of the palm on."""
    facing = np.sum(normals * palmar[weights.argmax(axis=1)], axis=1) > PALMAR_COSINE
    beyond_wrist = vertices[:, 0] > 0.012
    candidates = np.flatnonzero(facing & beyond_wrist)
    points = vertices[candidates]
    start = int(np.linalg.norm(points - 0.5 * (joints[0] + joints[8]), axis=1).argmin())
    chosen, nearest = [start], np.linalg.norm(points - points[start], axis=1)
    while len(chosen) < SENSOR_COUNT:
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return candidates[np.array(chosen)]


def _strongest(weights: Array, count: int) -> tuple[NDArray[np.int64], Array]:
    """The `count` strongest bones of each row and their weights, which sum to one."""
    bones = np.argsort(-weights, axis=1, kind="stable")[:, :count]
    top = np.take_along_axis(weights, bones, axis=1)
    return bones, top / top.sum(axis=1, keepdims=True)


def main() -> None:
    """Write the data file into the package."""
    path = Path(manipnet.synthesis.hand.__path__[0]) / "surface.npz"
    arrays = build()
    np.savez_compressed(path, allow_pickle=False, **arrays)
    print(f"{path}: {len(arrays['vertices'])} vertices, {len(arrays['faces'])} faces, {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
