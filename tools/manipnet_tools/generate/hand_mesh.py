"""Cuts the right hand of MakeHuman's default adult out of the body that `assets.makehuman` reads."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import Array
from manipnet_tools.assets.makehuman import METRES, Assets, MakeHumanError, average_targets, morphed_mesh

DIGITS: Final = tuple(tuple(f"finger{digit}-{bone}.R" for bone in (1, 2, 3)) for digit in (1, 2, 3, 4, 5))
PALM: Final = ("wrist.R", "metacarpal1.R", "metacarpal2.R", "metacarpal3.R", "metacarpal4.R", "lowerarm02.R")
FOREARM_M: Final = 0.045
"""How much of the forearm belongs to the hand."""


@dataclass(frozen=True, eq=False)
class HandMesh:
    """The right hand of the adult as it stands, in metres: a closed skin, its bones' weights, and its joints."""

    vertices: Array
    """`(V, 3)`"""
    faces: NDArray[np.int64]
    """`(N, 3)`, counter-clockwise from outside."""
    weights: Array
    """`(V, 16)`: of the palm, then of the three bones of each digit, the thumb's first. Each row sums to one."""
    wrist: Array
    """`(3,)`"""
    joints: Array
    """`(5, 4, 3)`: the start of each bone of each digit, and the end of the last one."""


def default_adult(assets: Assets, morphs: Mapping[str, float] | None = None) -> HandMesh:
    """The hand of MakeHuman's default adult, which is the mean of both sexes and of its three ancestries.

    `morphs` are targets of the folder `hands` and how far each is applied, such as `{"r-hand-scale-incr": 0.5}`.
    """
    shares = average_targets({"young": 1.0}) | {f"hands/{name}": share for name, share in (morphs or {}).items()}
    mesh = morphed_mesh(assets, shares)
    vertices, quads = METRES * mesh.points, mesh.quads
    groups = {name: np.unique(quads[rows]) for name, rows in mesh.groups.items()}
    bones = assets.json("rigs/standard/rig.default.json")
    heads = {
        name: vertices[groups[bones[name]["head"]["cube_name"]]].mean(axis=0) for name in ("wrist.R", *sum(DIGITS, ()))
    }
    tails = [vertices[groups[bones[digit[-1]]["tail"]["cube_name"]]].mean(axis=0) for digit in DIGITS]
    joints = np.array([[*(heads[bone] for bone in digit), tail] for digit, tail in zip(DIGITS, tails, strict=True)])
    weights = _weights(assets.json("rigs/standard/weights.default.json")["weights"], len(vertices))
    return _cut(vertices, quads[mesh.groups["body"]], weights, heads["wrist.R"], joints)


def _weights(content: Mapping[str, list], count: int) -> Array:
    weights = np.zeros((count, 16))
    columns = {bone: 0 for bone in PALM} | {bone: 1 + k for k, bone in enumerate(sum(DIGITS, ()))}
    for bone, column in columns.items():
        for vertex, weight in content[bone]:
            weights[vertex, column] += weight
    return weights


def _cut(vertices: Array, quads: NDArray[np.int64], weights: Array, wrist: Array, joints: Array) -> HandMesh:
    """The part of a body that is the hand with a stump of the forearm, closed where it is cut."""
    along = joints[2, 0] - wrist
    along = along / np.linalg.norm(along)
    reach = (vertices - wrist) @ along
    inside = (weights.sum(axis=1) > 0.0) & (reach > -FOREARM_M)
    quads = quads[inside[quads].all(axis=1)]
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    faces = faces[(faces[:, 0] != faces[:, 2]) & (faces[:, 1] != faces[:, 2])]
    edges = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    ordered = {tuple(edge) for edge in edges.tolist()}
    border = np.array([edge for edge in ordered if edge[::-1] not in ordered])
    if not len(border):
        raise MakeHumanError("the mesh of the hand is not connected to an arm; these are not MakeHuman's assets")
    centre = len(vertices)
    rim = np.unique(border)
    vertices = np.concatenate([vertices, vertices[rim].mean(axis=0)[None]])
    weights = np.concatenate([weights, np.eye(16)[:1]])
    faces = np.concatenate([faces, np.c_[border[:, ::-1], np.full(len(border), centre)]])
    used, compact = np.unique(faces, return_inverse=True)
    weights = weights[used] / weights[used].sum(axis=1, keepdims=True)
    return HandMesh(vertices[used], compact.reshape(-1, 3), weights, wrist, joints)
