"""Adds the motion of hands to the glTF file of an avatar, whose mesh, skin, materials and names stay as they are."""

from typing import Any

import numpy as np

from manipnet.geometry import Array, matrix_to_quat, quat_to_matrix
from manipnet.synthesis.objects.glb import node_matrices
from manipnet_tools.export.avatar_motion import MovedBone


def place_for_animation(node: dict[str, Any]) -> None:
    """Give a node its translation, rotation and scale in place of a matrix, which an animated node must not have."""
    if "matrix" not in node:
        return
    matrix = np.array(node.pop("matrix"), dtype=np.float64).reshape(4, 4).T
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    node["translation"], node["scale"] = matrix[:3, 3].tolist(), scale.tolist()
    node["rotation"] = matrix_to_quat(matrix[:3, :3] / scale).tolist()


def local_motion(document: dict[str, Any], parents: list[int], bone: int, moved: MovedBone) -> tuple[Array, Array]:
    """Translations `(T, 3)` and rotations `(T, 4)` of a node below its parent."""
    world = node_matrices(document)
    above = np.eye(4) if parents[bone] < 0 else world[parents[bone]]
    local = np.linalg.inv(_matrices(moved.parent_move) @ above) @ _matrices(moved.move) @ world[bone]
    scale = np.array(document["nodes"][bone].get("scale", [1.0, 1.0, 1.0]))
    u, _, v = np.linalg.svd(local[:, :3, :3] / scale)
    return local[:, :3, 3], matrix_to_quat(u @ v)


def _matrices(poses: Array) -> Array:
    """`(T, 4, 4)` of poses `(T, 7)`."""
    matrices = np.tile(np.eye(4), (len(poses), 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = quat_to_matrix(poses[:, 3:]), poses[:, :3]
    return matrices
