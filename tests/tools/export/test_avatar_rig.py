"""Exports on the rig of an avatar: mesh, bones and names are kept, and the fingertips are where they were solved."""

import json
import struct

import numpy as np
import pytest
from awkward_rigs import awkward_rig

from manipnet.demo.player import DEMO_FILE
from manipnet.geometry import SIDES, compose, quat_to_matrix
from manipnet.synthesis.hand.profile import FINGERS
from manipnet_tools.cli import main
from manipnet_tools.takes.bvh_motion import read_bvh

WORDS = ("Thumb", "Index", "Middle", "Ring", "Pinky")
FRAMES = (0, 400, 900, 1700)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("avatar")


@pytest.fixture(scope="module")
def avatar(folder):
    return awkward_rig(folder / "fox.glb")


@pytest.fixture(scope="module")
def solved(folder, avatar):
    """What `manipnet synthesize` writes for the profile that is imported from the avatar."""
    hand, out = folder / "fox.json", folder / "fingers.npz"
    meshes = [f"--mesh={name}={name}" for name in ("cube", "cylinder", "mug")]
    assert main(["hand", "import", str(avatar), "--out", str(hand)]) == 0
    assert main(["synthesize", str(DEMO_FILE), *meshes, "--hand", str(hand), "--out", str(out)]) == 0
    return out


def read(path):
    content = path.read_bytes()
    length = struct.unpack_from("<I", content, 12)[0]
    return json.loads(content[20 : 20 + length]), content[28 + length :]


def keys(document, binary, index):
    accessor = document["accessors"][index]
    start = document["bufferViews"][accessor["bufferView"]]["byteOffset"]
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
    return np.frombuffer(binary, "<f4", accessor["count"] * width, start).reshape(-1, width).astype(float)


def world_at(document, binary, frame):
    """The matrix of every node at a key frame of the first animation, by the rules of the glTF specification."""
    nodes = [dict(node) for node in document["nodes"]]
    animation = document["animations"][0]
    for channel in animation["channels"]:
        target = channel["target"]
        track = keys(document, binary, animation["samplers"][channel["sampler"]]["output"])
        nodes[target["node"]][target["path"]] = track[frame]
    parents = {child: k for k, node in enumerate(nodes) for child in node.get("children", [])}

    def local(node):
        if "matrix" in node:
            return np.array(node["matrix"]).reshape(4, 4).T
        matrix = np.eye(4)
        turn = quat_to_matrix(np.array(node.get("rotation", [0, 0, 0, 1]), dtype=float))
        matrix[:3, :3] = turn * np.array(node.get("scale", [1, 1, 1]))
        matrix[:3, 3] = node.get("translation", [0, 0, 0])
        return matrix

    def world(k):
        return local(nodes[k]) if k not in parents else world(parents[k]) @ local(nodes[k])

    return {node["name"]: world(k) for k, node in enumerate(nodes)}


def test_the_fingertips_of_the_avatar_are_where_they_were_solved(folder, avatar, solved):
    out = folder / "on_avatar.glb"
    assert main(["export", str(solved), "--format", "gltf", "--hand", str(avatar), "--out", str(out)]) == 0
    expected, (document, binary) = np.load(solved), read(out)
    for frame in FRAMES:
        world = world_at(document, binary, frame)
        for side in SIDES:
            joints = expected[f"{side}_hand_joints"][frame]
            np.testing.assert_allclose(world[f"{side.capitalize()}Hand"][:3, 3], joints[1, :3], atol=1e-3)
            for word, row in zip(WORDS, FINGERS, strict=True):
                chain = row if word == "Thumb" else row[1:]
                for n, k in enumerate(chain):
                    place = world[f"{side.capitalize()}Hand{word}{n + 1}"][:3, 3]
                    np.testing.assert_allclose(place, joints[k, :3], atol=1e-3)


def test_mesh_materials_names_and_other_bones_are_kept(folder, avatar, solved):
    out = folder / "kept.glb"
    assert main(["export", str(solved), "--format", "gltf", "--hand", str(avatar), "--out", str(out)]) == 0
    (before, before_binary), (after, after_binary) = read(avatar), read(out)
    assert [node["name"] for node in after["nodes"]][: len(before["nodes"])] == [n["name"] for n in before["nodes"]]
    assert after["meshes"][0] == before["meshes"][0]
    assert after["materials"][0] == before["materials"][0]
    assert after["skins"] == before["skins"]
    assert after["asset"]["copyright"] == "someone"
    assert after_binary.startswith(before_binary.rstrip(b"\0"))
    moved = {channel["target"]["node"] for channel in after["animations"][0]["channels"]}
    names = {after["nodes"][node]["name"] for node in moved}
    assert {"LeftHand", "RightHandIndex2", "mug"} <= names
    assert not {"Armature", "Hips", "LeftForeArm", "LeftHandIndex4"} & names
    assert {"cube", "cylinder", "mug"} <= {after["nodes"][n]["name"] for n in after["scenes"][0]["nodes"]}


def joints_of(path, frame):
    bvh = read_bvh(path)
    translations, rotations = bvh.local_transforms()
    world = {}
    for j, joint in enumerate(bvh.joints):
        pose = np.concatenate([translations[frame, j], rotations[frame, j]])
        world[j] = pose if joint.parent < 0 else compose(world[joint.parent], pose)
    return {joint.name: world[j][:3] for j, joint in enumerate(bvh.joints)}, bvh


def test_bvh_has_the_skeleton_of_the_avatar(folder, avatar, solved):
    """A BVH avatar, here the one that was written from the glTF file, keeps its unit and its joints."""
    assert main(["export", str(solved), "--format", "bvh", "--hand", str(avatar), "--out", str(folder / "bvh")]) == 0
    again = folder / "again"
    fox = folder / "bvh" / "fox.bvh"
    assert main(["export", str(solved), "--format", "bvh", "--hand", str(fox), "--out", str(again)]) == 0
    expected = np.load(solved)
    for path in (fox, again / "fox.bvh"):
        for frame in FRAMES:
            found, bvh = joints_of(path, frame)
            assert [joint.name for joint in bvh.joints][:4] == ["Armature", "Hips", "LeftForeArm", "LeftHand"]
            for side in SIDES:
                joints = expected[f"{side}_hand_joints"][frame]
                for word, row in zip(WORDS, FINGERS, strict=True):
                    for n, k in enumerate(row if word == "Thumb" else row[1:]):
                        place = 0.01 * found[f"{side.capitalize()}Hand{word}{n + 1}"]
                        np.testing.assert_allclose(place, joints[k, :3], atol=1e-3)


def test_an_avatar_without_a_mesh_and_a_map_without_an_avatar_are_refused(folder, solved, capsys):
    (folder / "a.bvh").write_text("HIERARCHY\n")
    (folder / "map.json").write_text("{}")
    source = ["export", str(solved), "--format", "gltf", "--out", str(folder / "x.glb")]
    assert main([*source, "--hand", str(folder / "a.bvh")]) != 0
    assert "has no mesh" in capsys.readouterr().err
    assert main([*source, "--hand", "adult", "--map", str(folder / "map.json")]) != 0
    assert "--map is for an avatar" in capsys.readouterr().err
