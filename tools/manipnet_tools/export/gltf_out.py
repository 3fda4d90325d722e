"""Writes hands and objects as glTF 2.0: hands as skinned meshes with skeletons, objects as meshes, and one animation.

Coordinates are right-handed, Y up, in metres, as glTF requires. Time starts at the first frame. The skin is that of the
model's hand, or the file is that of an avatar, whose own bones move.
"""

import copy
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from manipnet import __version__
from manipnet.geometry import MIRROR, Array, continuous_quats, mirror_points
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.objects.mesh import ClosedMesh
from manipnet.wire import Side
from manipnet_tools.export.animation import Animation, HandTrack
from manipnet_tools.export.avatar_gltf import local_motion, place_for_animation
from manipnet_tools.export.avatar_motion import AvatarMotion
from manipnet_tools.export.glb import ATTRIBUTE, INDEX, Buffer
from manipnet_tools.rendering import CERAMIC, SKIN_LEFT, SKIN_RIGHT, corner_normals
from manipnet_tools.takes.timecode_track import TimecodeTrack

_COLOURS: Mapping[Side, tuple[float, float, float]] = {"left": SKIN_LEFT, "right": SKIN_RIGHT}


def write_gltf(animation: Animation, path: Path, avatar: AvatarMotion | None = None) -> None:
    """Write `.glb` or `.gltf`; with an avatar, its own file with its bones in motion. Raises `OSError`."""
    scene = _Document(animation, {}, b"") if avatar is None else _Document(animation, *avatar.rig.skeleton.document)
    if avatar is not None:
        scene.move_bones(avatar)
    for side, hand in animation.hands.items() if avatar is None else ():
        scene.add_hand(side, hand)
    for name, body in animation.objects.items():
        scene.add_object(name, body.poses, animation.meshes.get(name))
    scene.save(path)


class _Document:
    """A document that grows node by node, from nothing or from the document of an avatar."""

    def __init__(self, animation: Animation, document: dict[str, Any], binary: bytes) -> None:
        self._buffer = Buffer(document, binary)
        self._before = copy.deepcopy(document)
        parts = ("nodes", "meshes", "materials", "skins")
        self._document: dict[str, list[Any]] = {part: self._before.pop(part, []) for part in parts}
        self._skins = self._document.pop("skins")
        self._roots: list[int] = []
        self._channels: list[dict[str, Any]] = []
        self._samplers: list[dict[str, Any]] = []
        self._name = animation.name
        time_s = animation.time_s - animation.time_s[0]
        self._timecode = _timecode(animation.timecode, time_s)
        self._times = self._buffer.add(time_s.astype(np.float32), bounds=True)

    def add_hand(self, side: Side, hand: HandTrack) -> None:
        """Add the skeleton of a hand, with its fingertips, and the skin that follows it."""
        first, model = len(self._document["nodes"]), hand.model
        for joint, name in enumerate(model.joint_names):
            children = [first + int(child) for child in np.flatnonzero(joint == model.parents)]
            node = self._node(f"{side}_{name}", hand.offsets[joint], None, children)
            if joint == 0:
                self._animate(node, hand.wrist[:, :3], hand.wrist[:, 3:])
            elif joint < model.bone_count:
                self._animate(node, None, hand.rotations[:, joint])
        mesh, bind = self._skin_mesh(model, side, hand.scale)
        skin = {"joints": list(range(first, first + model.joint_count)), "skeleton": first, "inverseBindMatrices": bind}
        self._skins.append(skin | {"name": f"{side}_hand"})
        body = self._node(f"{side}_hand", None, mesh, [])
        self._document["nodes"][body]["skin"] = len(self._skins) - 1
        self._roots += [first, body]

    def move_bones(self, avatar: AvatarMotion) -> None:
        """Animate the bones of the hands in the document of an avatar."""
        document, parents = avatar.rig.skeleton.document[0], avatar.rig.skeleton.parents
        for bone, moved in avatar.bones.items():
            place_for_animation(self._document["nodes"][bone])
            positions, quats = local_motion(document, parents, bone, moved)
            self._animate(bone, positions if moved.is_hand else None, quats)

    def add_object(self, name: str, poses: Array, mesh: ClosedMesh | None) -> None:
        """Add a moving mesh, or only a moving node if the shape of the object is not known."""
        index = None
        if mesh is not None:
            vertices, normals, faces = split_creases(mesh.vertices, mesh.faces)
            index = self._mesh(name, vertices, normals, faces, CERAMIC, {})
        node = self._node(name, None, index, [])
        self._animate(node, poses[:, :3], poses[:, 3:])
        self._roots.append(node)

    def save(self, path: Path) -> None:
        """Write the document."""
        before = self._before
        optional = {key: value for key, value in (self._document | {"skins": self._skins}).items() if value}
        animation = {"name": self._name, "channels": self._channels, "samplers": self._samplers, **self._timecode}
        asset = before.pop("asset", {}) | {"version": "2.0", "generator": f"ManipNet Live {__version__}"}
        scenes = before.pop("scenes", [{"name": self._name, "nodes": []}])
        shown = scenes[before.pop("scene", 0)]
        shown["nodes"] = shown.get("nodes", []) + self._roots
        animations = [animation, *before.pop("animations", [])]
        first = {"asset": asset, "scene": scenes.index(shown), "scenes": scenes, "animations": animations}
        self._buffer.save(path, first | before | optional)

    def _node(self, name: str, offset: Array | None, mesh: int | None, children: list[int]) -> int:
        node: dict[str, Any] = {"name": name}
        if offset is not None:
            node["translation"] = offset.tolist()
        if mesh is not None:
            node["mesh"] = mesh
        if children:
            node["children"] = children
        self._document["nodes"].append(node)
        return len(self._document["nodes"]) - 1

    def _animate(self, node: int, positions: Array | None, quats: Array) -> None:
        """Keys for every frame; the node itself stands as in the first one."""
        tracks = {"rotation": continuous_quats(quats)} | ({} if positions is None else {"translation": positions})
        for path, values in tracks.items():
            keys = values.astype(np.float32)
            sampler = {"input": self._times, "output": self._buffer.add(keys), "interpolation": "LINEAR"}
            self._samplers.append(sampler)
            self._channels.append({"sampler": len(self._samplers) - 1, "target": {"node": node, "path": path}})
            self._document["nodes"][node][path] = keys[0].tolist()

    def _skin_mesh(self, model: Hand, side: Side, scale: float) -> tuple[int, int]:
        """Add the skin of a hand in its bind pose.

        Returns the indices of its mesh and of the accessor of its inverse bind matrices.
        """
        positions, rotations = forward_kinematics(model, model.skin.bind_angles)
        vertices, faces = scale * model.skin.vertices, model.skin.faces
        joints = np.arange(model.joint_count)
        matrices = np.tile(np.eye(4), (len(joints), 1, 1))
        matrices[:, :3, :3] = rotations[np.where(joints < model.bone_count, joints, model.parents)]
        matrices[:, :3, 3] = scale * positions
        if side == "left":
            vertices, faces = mirror_points(vertices), faces[:, ::-1]
            matrices[:, :3, :3] = MIRROR @ matrices[:, :3, :3] @ MIRROR
            matrices[:, :3, 3] = mirror_points(matrices[:, :3, 3])
        bind = np.linalg.inv(matrices)
        bind[:, 3] = [0.0, 0.0, 0.0, 1.0]
        weights = _unit_sum(model.skin.weights)
        bones = np.where(weights > 0.0, model.skin.bones, 0).astype(np.uint8)
        attributes = {
            "JOINTS_0": self._buffer.add(bones, ATTRIBUTE),
            "WEIGHTS_0": self._buffer.add(weights, ATTRIBUTE),
        }
        normals = _vertex_normals(vertices, faces)
        mesh = self._mesh(f"{side}_hand", vertices, normals, faces, _COLOURS[side], attributes)
        return mesh, self._buffer.add(bind.astype(np.float32))

    def _mesh(
        self,
        name: str,
        vertices: Array,
        normals: Array,
        faces: NDArray[np.integer[Any]],
        colour: tuple[float, float, float],
        attributes: dict[str, int],
    ) -> int:
        surface = {"baseColorFactor": [*colour, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.65}
        self._document["materials"].append({"name": name, "pbrMetallicRoughness": surface})
        attributes = {
            "POSITION": self._buffer.add(vertices.astype(np.float32), ATTRIBUTE, bounds=True),
            "NORMAL": self._buffer.add(normals.astype(np.float32), ATTRIBUTE),
            **attributes,
        }
        indices = faces.reshape(-1).astype(np.uint16 if len(vertices) < 65_535 else np.uint32)
        primitive = {"attributes": attributes, "indices": self._buffer.add(indices, INDEX)}
        material = {"material": len(self._document["materials"]) - 1}
        self._document["meshes"].append({"name": name, "primitives": [primitive | material]})
        return len(self._document["meshes"]) - 1


def _timecode(timecode: TimecodeTrack | None, time_s: Array) -> dict[str, Any]:
    """The application-specific data of the animation: its first timecode, when that is, and its rate."""
    first = None if timecode is None else next((k for k, text in enumerate(timecode.texts) if text), None)
    if timecode is None or first is None:
        return {}
    about = {"timecode": timecode.texts[first], "timecode_time_s": float(time_s[first])}
    return {"extras": about | ({} if timecode.rate is None else {"timecode_rate": timecode.rate})}


def split_creases(vertices: Array, faces: NDArray[np.integer[Any]]) -> tuple[Array, Array, NDArray[np.integer[Any]]]:
    """Give each side of a sharp edge vertices of its own, so that it looks sharp.

    Returns the new vertices, their unit normals, and the faces.
    """
    normals = corner_normals(vertices, faces.astype(np.int64)).reshape(-1, 3)
    corners = np.concatenate([faces.reshape(-1, 1), np.round(normals * 1e4)], axis=1)
    _, first, corner = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    return vertices[faces.reshape(-1)[first]], normals[first], corner.reshape(-1, 3)


def _vertex_normals(vertices: Array, faces: NDArray[np.integer[Any]]) -> Array:
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    normals = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normals, faces[:, corner], np.cross(b - a, c - a))
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _unit_sum(weights: Array) -> NDArray[np.float32]:
    """Weights `(V, 4)`, whose first column is the largest, rounded so that they sum to one in single precision."""
    rounded = weights.astype(np.float32)
    rounded[:, 0] = np.float32(1.0) - rounded[:, 1:].sum(axis=1, dtype=np.float32)
    return rounded
