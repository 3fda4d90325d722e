"""Generates the skin and the sensors of the shipped hand: `python -m manipnet_tools.assets.hand_surface`.

It rewrites `hand.npz` of every shipped bundle. A model is trained on its sensors, so changing them makes it unusable.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import Array
from manipnet.synthesis.hand.hand import Hand, Sensors, Skin
from manipnet.synthesis.hand.hand_file import HAND_FILE, write_hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.model.shipped import shipped_bundles, shipped_hand
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
"""A vertex belongs to the palm side if its normal is within about 63 degrees of the direction of its bone's flexion."""


def with_surface(hand: Hand) -> Hand:
    """The hand with a new skin and new sensors around its bones."""
    joints, rotations = forward_kinematics(hand, hand.skin.bind_angles)
    shape = bind_shape(hand, joints, rotations)
    low, high = joints.min(axis=0) - 0.05, joints.max(axis=0) + 0.05
    low[0] = -0.07
    vertices, faces = extract(shape.distance, low, high, CELL_M)
    vertices, normals = polish(shape.distance, vertices, faces, POLISH_ROUNDS)
    weights = skin_weights(hand, shape, vertices, faces)
    bones, top = _strongest(weights, BONES_PER_VERTEX)
    skin = Skin(vertices, faces.astype(np.int32), bones, top, hand.skin.bind_angles)
    palmar = palmar_directions(hand, joints, rotations)
    chosen = choose_sensors(vertices, normals, weights, palmar, joints)
    sensor_bones, sensor_weights = _strongest(weights[chosen], SENSOR_BONES)
    to_bone = np.swapaxes(rotations, 1, 2)[sensor_bones]
    relative = vertices[chosen][:, None] - joints[sensor_bones]
    sensors = Sensors(
        sensor_bones,
        sensor_weights,
        np.einsum("skij,skj->ski", to_bone, relative),
        np.einsum("skij,sj->ski", to_bone, normals[chosen]),
        hand.sensors.grid_center,
    )
    return replace(hand, skin=skin, sensors=sensors)


def skin_weights(hand: Hand, shape: HandShape, vertices: Array, faces: NDArray) -> Array:
    """Weights `(V, B)` that sum to one, by the distance to each bone's flesh, smoothed along the skin.

    A bone shares vertices only with its parent and children, so that fingers never drag their neighbours along.
    """
    distance = shape.bone_distances(vertices)
    main = distance.argmin(axis=1)
    related = np.eye(hand.bone_count, dtype=bool)
    for bone in range(1, hand.bone_count):
        related[bone, hand.parents[bone]] = related[hand.parents[bone], bone] = True
    related[2, 0] = related[0, 2] = True  # bone 1 has no flesh of its own
    nearness = np.exp(-(distance - distance.min(axis=1, keepdims=True)) / WEIGHT_FALLOFF_M)
    weights = np.where(related[main], nearness, 0.0)
    for _ in range(WEIGHT_SMOOTHING):
        weights = 0.5 * weights + 0.5 * neighbour_mean(weights, faces)
    return weights / weights.sum(axis=1, keepdims=True)


def choose_sensors(vertices: Array, normals: Array, weights: Array, palmar: Array, joints: Array) -> NDArray[np.int64]:
    """Indices of vertices of the palm side, spread evenly by farthest-point sampling, which starts at the palm."""
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
    """Rewrite the hand of the shipped bundles that have the dataset subject's; the free hand has a skin of its own."""
    subject = shipped_hand()
    for model, folder in shipped_bundles().items():
        if shipped_hand(model).name != subject.name:
            continue
        path = folder / HAND_FILE
        hand = with_surface(subject)
        write_hand(hand, path)
        print(f"{path}: {len(hand.skin.vertices)} vertices, {hand.sensor_count} sensors, {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
