"""The tree of the nodes of a glTF file: who contains whom, and where each node is in the scene."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from manipnet.synthesis.objects.glb_accessors import GlbError


def node_parents(nodes: list[dict[str, Any]]) -> dict[int, int]:
    """The parent of each node that has one. Raises `GlbError`."""
    parents: dict[int, int] = {}
    for n, node in enumerate(nodes):
        for child in node.get("children", []):
            if not 0 <= child < len(nodes):
                raise GlbError(f"is a damaged glTF file (node {child} in node {n} is not there); export it again")
            if child in parents:
                raise GlbError(
                    f"is a damaged glTF file (node {child} is in both {parents[child]} and {n}); export it again"
                )
            parents[child] = n
    return parents


def node_worlds(nodes: list[dict[str, Any]], parents: Mapping[int, int]) -> list[NDArray]:
    """The matrix `(4, 4)` from each node to the scene. Raises `GlbError`."""
    worlds: list[NDArray] = [np.eye(4)] * len(nodes)
    waiting, placed = [n for n in range(len(nodes)) if n not in parents], 0
    while waiting:
        node = waiting.pop()
        above, local = parents.get(node), _local_matrix(nodes[node])
        worlds[node] = local if above is None else worlds[above] @ local
        waiting += nodes[node].get("children", [])
        placed += 1
    if placed < len(nodes):
        raise GlbError("is a damaged glTF file (its nodes contain each other); export it again")
    return worlds


def _local_matrix(node: dict[str, Any]) -> NDArray:
    """The matrix from a node to its parent."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    return matrix_of(**{part: node[part] for part in ("translation", "rotation", "scale") if part in node})


def matrix_of(translation: Any = (0, 0, 0), rotation: Any = (0, 0, 0, 1), scale: Any = (1, 1, 1)) -> NDArray:
    """The matrix `(4, 4)` of a place, a quaternion xyzw and a scale."""
    x, y, z, w = np.asarray(rotation, dtype=np.float64) / max(float(np.linalg.norm(rotation)), 1e-12)
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = turn * np.asarray(scale, dtype=np.float64)
    matrix[:3, 3] = translation
    return matrix
