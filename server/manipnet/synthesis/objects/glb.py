"""Reads the triangles of a glTF Binary file: all meshes of its scene as they are placed there, in metres.

Only what shapes the surface is read: nodes, instances, triangles in all their encodings, morph weights and skins in the
pose of the file. Materials, lights, cameras and animations are not. A file may require extensions of its readers; one
that changes the surface and is not read here is named in the error. Source: the glTF 2.0 specification.
"""

import json
import struct
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from manipnet.synthesis.objects.glb_accessors import Accessors, GlbError, check_size
from manipnet.synthesis.objects.glb_draco import DRACO, decode_draco
from manipnet.synthesis.objects.glb_nodes import matrix_of, node_parents, node_worlds

READ: Final = {
    DRACO,
    "KHR_mesh_quantization",
    "EXT_mesh_gpu_instancing",
    "KHR_node_visibility",
}
MESHOPT: Final = ("EXT_meshopt_compression", "KHR_meshopt_compression")
APPEARANCE: Final = (
    *("KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_", "EXT_lights_", "MSFT_lod"),
    *("KHR_xmp", "KHR_animation", "KHR_audio", "ADOBE_materials_", "EXT_materials_", "VRM", "EXT_lights"),
)
"""Extensions that begin so leave the surface as it is."""
MAX_INSTANCES: Final = 10_000
_HUGE_M: Final = 1e9
_TRIANGLES, _STRIP, _FAN = 4, 5, 6


def read_glb(data: bytes) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices `(V, 3)` in metres and triangles `(F, 3)`. Raises `GlbError`."""
    document, binary = glb_chunks(data)
    try:
        _check_extensions(document)
        with np.errstate(all="ignore"):  # numbers that are not finite are refused when the mesh is checked
            return _Scene(document, binary).triangles()
    except GlbError:
        raise
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, RecursionError, OverflowError) as error:
        raise GlbError(f"is a damaged glTF file ({type(error).__name__}: {error}); export it again") from None


def glb_chunks(data: bytes) -> tuple[dict[str, Any], bytes]:
    """The JSON document and the binary chunk of a glTF Binary file. Raises `GlbError`."""
    if data[:4] != b"glTF":
        hint = "; it is a .gltf file: export it as glTF Binary (.glb)" if data.lstrip()[:1] == b"{" else ""
        raise GlbError(f"is not a glTF Binary file: it does not begin with glTF{hint or '; export it again'}")
    try:
        version, length = struct.unpack_from("<2I", data, 4)
        if version != 2:
            raise GlbError(f"is glTF {version}; only glTF 2 can be read, so export it again with a newer program")
        at, chunks = 12, {}
        while at + 8 <= min(length, len(data)):
            size, kind = struct.unpack_from("<I4s", data, at)
            if at + 8 + size > len(data):
                raise GlbError("is cut off; copy or export it again")
            chunks.setdefault(kind, data[at + 8 : at + 8 + size])
            at += 8 + size
        document = json.loads(chunks[b"JSON"])
    except (struct.error, KeyError, ValueError, RecursionError) as error:
        if isinstance(error, GlbError):
            raise
        raise GlbError(f"is a damaged glTF file ({error}); export it again") from None
    if not isinstance(document, dict):
        raise GlbError("is a damaged glTF file (its JSON is not an object); export it again")
    return document, chunks.get(b"BIN\0", b"")


def _check_extensions(document: dict[str, Any]) -> None:
    """Raise `GlbError` for an extension that the file requires and that is not read."""
    required = document.get("extensionsRequired", [])
    if compressed := [name for name in required if name in MESHOPT]:
        raise GlbError(f"is compressed with {compressed[0]}, which cannot be read; export it without compression")
    if unknown := [name for name in required if name not in READ and not str(name).startswith(APPEARANCE)]:
        raise GlbError(f"requires the extension {unknown[0]}, which cannot be read; export it without this extension")


@dataclass(frozen=True)
class GlbRig:
    """The nodes of a file and its skinned vertices, in the pose of the file, in metres."""

    names: list[str]
    """Of the nodes; those that a VRM file maps to a humanoid have the humanoid's names."""
    parents: list[int]
    """The parent of each node, -1 for a root."""
    positions: NDArray[np.float64]
    """`(N, 3)`"""
    vertices: NDArray[np.float64]
    """`(V, 3)`"""
    faces: NDArray[np.int64]
    """`(F, 3)`"""
    owners: NDArray[np.int64]
    """`(V, 4)` the nodes that move each vertex."""
    weights: NDArray[np.float64]
    """`(V, 4)` how much each of them moves it."""
    humanoid: frozenset[int]
    """The nodes that a VRM file maps to a humanoid."""
    joints: frozenset[int]
    """The nodes that move a skin."""
    bare: frozenset[int]
    """The nodes without a mesh."""


def read_glb_rig(data: bytes) -> GlbRig:
    """The skeleton of a glTF Binary or VRM file. Raises `GlbError`."""
    document, binary = glb_chunks(data)
    try:
        _check_extensions(document)
        with np.errstate(all="ignore"):  # numbers that are not finite are refused with the name of their node
            return _Scene(document, binary).rig()
    except GlbError:
        raise
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, RecursionError, OverflowError) as error:
        raise GlbError(f"is a damaged glTF file ({type(error).__name__}: {error}); export it again") from None


def node_matrices(document: dict[str, Any]) -> NDArray[np.float64]:
    """The matrices `(N, 4, 4)` from the nodes of a document to its scene. Raises `GlbError`."""
    return np.array(_Scene(document, b"").worlds).reshape(-1, 4, 4)


def _humanoid_names(document: dict[str, Any]) -> dict[int, str]:
    """The names that a VRM file, 0 or 1, gives to nodes."""
    extensions = document.get("extensions", {})
    if "VRMC_vrm" in extensions:
        bones = extensions["VRMC_vrm"]["humanoid"]["humanBones"]
        return {int(bone["node"]): str(name) for name, bone in bones.items()}
    bones = extensions.get("VRM", {}).get("humanoid", {}).get("humanBones", [])
    return {int(bone["node"]): str(bone["bone"]) for bone in bones}


class _Scene:
    """The nodes of a document."""

    def __init__(self, document: dict[str, Any], binary: bytes) -> None:
        self._document, self._accessors = document, Accessors(document, binary)
        self._nodes: list[dict[str, Any]] = document.get("nodes", [])
        self._parents = node_parents(self._nodes)
        self.worlds = node_worlds(self._nodes, self._parents)
        self._required = set(document.get("extensionsRequired", []))

    def triangles(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """The triangles of all nodes of the scene, in the world."""
        vertices, faces, total = [np.empty((0, 3))], [np.empty((0, 3), np.int64)], 0
        for node in self._visible():
            if "mesh" not in self._nodes[node]:
                continue
            for matrix, points, corners in self._placed(node):
                check_size(total + len(points))
                placed = points @ matrix[:3, :3].T + matrix[:3, 3]
                mirrored = np.linalg.det(matrix[:3, :3]) < 0.0
                faces.append(total + (corners[:, ::-1] if mirrored else corners))
                vertices.append(placed)
                total += len(points)
        if sum(map(len, faces)) == 0:
            raise GlbError("holds no triangles; export the surface, not points, curves or an empty scene")
        return np.concatenate(vertices), np.concatenate(faces)

    def rig(self) -> GlbRig:
        """The nodes and the skinned vertices."""
        humanoid = _humanoid_names(self._document)
        names = [humanoid.get(n, str(node.get("name", n))) for n, node in enumerate(self._nodes)]
        positions = np.array(self.worlds).reshape(-1, 4, 4)[:, :3, 3]
        for name, place in zip(names, positions, strict=True):
            if not (np.abs(place) < _HUGE_M).all():
                raise GlbError(f"has a node {name!r} whose place is not finite; export it again")
        vertices, faces = [np.empty((0, 3))], [np.empty((0, 3), np.int64)]
        owners, weights, total = [np.empty((0, 4), np.int64)], [np.empty((0, 4))], 0
        for n, node in enumerate(self._nodes):
            if "skin" not in node or "mesh" not in node:
                continue
            joints = np.array(self._document["skins"][node["skin"]]["joints"], np.int64)
            if joints.min() < 0:
                raise GlbError("is a damaged glTF file (a skin has a joint with a negative number); export it again")
            for primitive in self._document["meshes"][node["mesh"]]["primitives"]:
                attributes = primitive["attributes"]
                if "JOINTS_0" not in attributes:
                    continue
                if self._is_draco(primitive):
                    raise GlbError(f"has a skin that is compressed with {DRACO}; export it without compression")
                if (part := self._primitive(n, primitive, [])) is None:
                    continue
                if not (np.abs(part[0]) < _HUGE_M).all():
                    raise GlbError(f"has vertices in the mesh of {names[n]!r} that are not finite; export it again")
                vertices.append(part[0])
                faces.append(total + part[1])
                owners.append(joints[self._accessors.read(attributes["JOINTS_0"], 4).astype(np.int64)])
                weights.append(self._accessors.read(attributes["WEIGHTS_0"], 4))
                total += len(part[0])
        parents = [self._parents.get(n, -1) for n in range(len(self._nodes))]
        points, corners = np.concatenate(vertices), np.concatenate(faces)
        skin = points, corners, np.concatenate(owners), np.concatenate(weights)
        joints = frozenset(joint for each in self._document.get("skins", []) for joint in each["joints"])
        bare = frozenset(n for n, node in enumerate(self._nodes) if "mesh" not in node)
        return GlbRig(names, parents, positions, *skin, frozenset(humanoid), joints, bare)

    def _visible(self) -> list[int]:
        """The nodes of the scene in order, without those that are hidden."""
        scenes = self._document.get("scenes", [])
        roots = [n for n in range(len(self._nodes)) if n not in self._parents]
        waiting = list(scenes[self._document.get("scene", 0)].get("nodes", []) if scenes else roots)[::-1]
        order: list[int] = []
        seen: set[int] = set()
        while waiting:
            node = waiting.pop()
            if node in seen:
                raise GlbError(f"is a damaged glTF file (node {node} is in it twice); export it again")
            seen.add(node)
            if _extension(self._nodes[node], "KHR_node_visibility").get("visible", True):
                order.append(node)
                waiting += self._nodes[node].get("children", [])[::-1]
        return order

    def _placed(self, node: int) -> list[tuple[NDArray, NDArray, NDArray]]:
        """Matrix, vertices and triangles of every primitive and instance of a node."""
        mesh = self._document["meshes"][self._nodes[node]["mesh"]]
        weights = self._nodes[node].get("weights", mesh.get("weights", []))
        parts = [
            part for primitive in mesh["primitives"] if (part := self._primitive(node, primitive, weights)) is not None
        ]
        if "skin" in self._nodes[node]:  # its joints place it, whatever the node's own transform is
            return [(np.eye(4), *part) for part in parts]
        return [(matrix, *part) for matrix in self._instances(node) for part in parts]

    def _primitive(self, node: int, primitive: dict[str, Any], weights: list[float]) -> tuple[NDArray, NDArray] | None:
        """Vertices and triangles; None for points and lines."""
        mode = primitive.get("mode", _TRIANGLES)
        if mode not in (_TRIANGLES, _STRIP, _FAN):
            return None
        position = primitive["attributes"]["POSITION"]
        if self._is_draco(primitive):
            points, corners = decode_draco(self._accessors.view(_extension(primitive, DRACO)["bufferView"]))
        else:
            points = self._accessors.read(position, 3)
            indices = primitive.get("indices")
            loose = (
                np.arange(len(points)) if indices is None else self._accessors.read(indices, 1)[:, 0].astype(np.int64)
            )
            corners = _corners(loose, mode)
        if len(corners) and not 0 <= corners.min() <= corners.max() < len(points):
            raise GlbError(f"has a triangle with vertex {corners.max()} of {len(points)}; export it again")
        for target, weight in zip(primitive.get("targets", []), weights, strict=False):
            if weight and "POSITION" in target:
                points = points + float(weight) * self._accessors.read(target["POSITION"], 3)
        skin = self._nodes[node].get("skin")
        return (points if skin is None else self._skinned(points, primitive["attributes"], skin)), corners

    def _is_draco(self, primitive: dict[str, Any]) -> bool:
        """Whether a primitive has its data only in compressed form, or is to be read from it."""
        has_data = self._accessors.has_data(primitive["attributes"]["POSITION"])
        return bool(_extension(primitive, DRACO)) and (DRACO in self._required or not has_data)

    def _instances(self, node: int) -> list[NDArray]:
        """The world matrices of a node's copies."""
        world = self.worlds[node]
        attributes = _extension(self._nodes[node], "EXT_mesh_gpu_instancing").get("attributes")
        if not attributes:
            return [world]
        parts = {
            name: self._accessors.read(i, 4 if name == "ROTATION" else 3)
            for name, i in attributes.items()
            if name in ("TRANSLATION", "ROTATION", "SCALE")
        }
        count = min(map(len, parts.values()), default=1)
        if count > MAX_INSTANCES:
            raise GlbError(f"has {count} copies of one mesh; at most {MAX_INSTANCES} are allowed")
        return [world @ matrix_of(**{name.lower(): values[i] for name, values in parts.items()}) for i in range(count)]

    def _skinned(self, points: NDArray, attributes: dict[str, int], skin: int) -> NDArray:
        """Vertices as the joints of a skin place them in the pose of the file."""
        joints = self._document["skins"][skin]["joints"]
        matrices = np.stack([self.worlds[joint] for joint in joints])
        if (inverse := self._document["skins"][skin].get("inverseBindMatrices")) is not None:
            matrices = matrices @ self._accessors.read(inverse, 16)[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1)
        ones = np.concatenate([points, np.ones((len(points), 1))], axis=1)
        placed, total = np.zeros((len(points), 4)), np.zeros((len(points), 1))
        for n in range(4):
            if f"JOINTS_{n}" not in attributes:
                break
            owners = self._accessors.read(attributes[f"JOINTS_{n}"], 4).astype(np.int64)
            shares = self._accessors.read(attributes[f"WEIGHTS_{n}"], 4)
            for k in range(4):
                placed += shares[:, k : k + 1] * np.einsum("nij,nj->ni", matrices[owners[:, k]], ones)
                total += shares[:, k : k + 1]
        return placed[:, :3] / np.where(total > 0.0, total, 1.0)


def _corners(indices: NDArray, mode: int) -> NDArray:
    """Triangles `(F, 3)` of a list, a strip or a fan of vertices."""
    if mode == _TRIANGLES:
        return indices[: len(indices) // 3 * 3].reshape(-1, 3)
    count = max(len(indices) - 2, 0)
    k = np.arange(count)
    if mode == _FAN:
        return np.stack([indices[k + 1], indices[k + 2], np.broadcast_to(indices[:1], count)], axis=1)
    return np.stack([indices[k], indices[k + 1 + k % 2], indices[k + 2 - k % 2]], axis=1)


def _extension(part: dict[str, Any], name: str) -> dict[str, Any]:
    return part.get("extensions", {}).get(name, {})
