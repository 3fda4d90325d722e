"""Rigs for tests as real tools write them: turned bones, an armature in centimetres with Z up, bent fingers, a skin."""

import json
from pathlib import Path

import numpy as np

from manipnet.geometry import SIDES, quat_exp, quat_to_matrix
from manipnet.synthesis.hand.model_profile import model_profile
from manipnet.synthesis.hand.profile import FINGERS
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet_tools.export.glb import Buffer

WORDS = ("Thumb", "Index", "Middle", "Ring", "Pinky")
RADIUS_M = 0.007
"""The skin's distance from the bones of the fingers."""
ARMATURE = np.eye(4)
ARMATURE[:3, :3] = 0.01 * quat_to_matrix(quat_exp(np.array([-np.pi / 2, 0.0, 0.0])))


def awkward_rig(path: Path, bend_rad: float = 0.3) -> Path:
    """A skinned `.glb` with both hands of the model, 10 % smaller, its fingers bent, every bone turned at random."""
    rng = np.random.default_rng(5)
    names, parents, heads = ["Armature", "Hips"], [-1, 0], [np.zeros(3), np.array([0.0, 1.0, 0.0])]
    for side in SIDES:
        joints = 0.9 * model_profile(shipped_hand(), side).joints[:, :3]
        turn = quat_to_matrix(quat_exp(np.array([0.2, -1.3 if side == "left" else 1.3, 0.4])))
        at = np.array([0.6 if side == "left" else -0.6, 1.3, 0.1])
        names += [f"{side.capitalize()}ForeArm", f"{side.capitalize()}Hand"]
        parents += [1, len(names) - 2]
        heads += [at + turn @ [0.0, 0.0, 0.25], at]
        hand = len(names) - 1
        for word, row in zip(WORDS, FINGERS, strict=True):
            above, point, bent = hand, None, np.eye(3)
            chain = row if word == "Thumb" else row[1:]
            for n, k in enumerate(chain):
                point = joints[k] if n == 0 else point + bent @ (joints[k] - joints[chain[n - 1]])
                bent = quat_to_matrix(quat_exp(np.array([-bend_rad, 0.0, 0.0]))) @ bent if word != "Thumb" else bent
                names.append(f"{side.capitalize()}Hand{word}{n + 1}")
                parents.append(above)
                heads.append(at + turn @ point)
                above = len(names) - 1
    world = [ARMATURE]
    for head in heads[1:]:
        matrix = np.eye(4)
        matrix[:3, :3] = 0.01 * quat_to_matrix(quat_exp(rng.normal(0.0, 1.0, 3)))
        matrix[:3, 3] = head
        world.append(matrix)
    _write(path, names, parents, np.array(world))
    return path


def _rings(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Points `(24, 3)` of a skin around a bone."""
    along = end - start
    u = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    u /= np.linalg.norm(u)
    v = np.cross(along / np.linalg.norm(along), u)
    turns = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)[:, None]
    ring = RADIUS_M * (np.cos(turns) * u + np.sin(turns) * v)
    return np.concatenate([start + t * along + ring for t in (0.4, 0.6, 0.8)])


def _write(path: Path, names: list[str], parents: list[int], world: np.ndarray) -> None:
    buffer, nodes = Buffer(), []
    for k, (name, parent) in enumerate(zip(names, parents, strict=True)):
        local = world[k] if parent < 0 else np.linalg.inv(world[parent]) @ world[k]
        node = {"name": name, "matrix": local.T.reshape(-1).tolist()}
        if children := [c for c, p in enumerate(parents) if p == k]:
            node["children"] = children
        nodes.append(node)
    around = np.array([[0.004, 0, 0], [-0.004, 0, 0], [0, 0.004, 0], [0, -0.004, 0], [0, 0, 0.004], [0, 0, -0.004]])
    below = [k for k, p in enumerate(parents) if p >= 0 and names[p][-1].isdigit()]
    rings = [(k, _rings(world[parents[k], :3, 3], world[k, :3, 3])) for k in below]
    vertices = np.concatenate([(world[:, None, :3, 3] + around).reshape(-1, 3), *(points for _, points in rings)])
    owners = np.zeros((len(vertices), 4), np.uint8)
    owned = [np.repeat(np.arange(len(names)), len(around)), *(np.full(len(p), parents[k]) for k, p in rings)]
    owners[:, 0] = np.concatenate(owned)
    faces = (np.array([[0, 2, 4], [0, 4, 3], [1, 4, 2], [1, 3, 4]]) + 6 * np.arange(len(names))[:, None, None]).ravel()
    attributes = {
        "POSITION": buffer.add(vertices.astype(np.float32), bounds=True),
        "JOINTS_0": buffer.add(owners),
        "WEIGHTS_0": buffer.add(np.tile(np.array([1, 0, 0, 0], np.float32), (len(vertices), 1))),
    }
    primitive = {"attributes": attributes, "indices": buffer.add(faces.astype(np.uint16)), "material": 0}
    inverse = np.linalg.inv(world)
    inverse[:, 3] = [0, 0, 0, 1]
    document = {
        "asset": {"version": "2.0", "copyright": "someone"},
        "scene": 0,
        "scenes": [{"name": "Stage", "nodes": [0, len(names)]}],
        "nodes": [*nodes, {"name": "Body", "mesh": 0, "skin": 0}],
        "meshes": [{"name": "Skin", "primitives": [primitive]}],
        "materials": [{"name": "Fur", "pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.4, 0.1, 1.0]}}],
        "skins": [{"joints": list(range(len(names))), "inverseBindMatrices": buffer.add(inverse.astype(np.float32))}],
    }
    buffer.save(path, json.loads(json.dumps(document)))
