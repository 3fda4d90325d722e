"""Hands of avatars imported from rigs: names, units, sides, straightening, and what is refused."""

import json

import numpy as np
import pytest
from rig_writer import write_glb

from manipnet.geometry import SIDES, quat_exp, quat_rotate
from manipnet.synthesis.hand.model_profile import model_profile
from manipnet.synthesis.hand.profile import FINGERS, ProfileError, read_profile
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet_tools.cli import main
from manipnet_tools.hands.importing import import_profile
from manipnet_tools.hands.rig_file import RigFileError

MODEL = shipped_hand()
WORDS = ("Thumb", "Index", "Middle", "Ring", "Pinky")
TURN = quat_exp(np.array([0.4, -1.1, 0.7]))


def rig(scale=1.0, name="{side}Hand{word}{n}", hand="{side}Hand", tips=True, sides=SIDES, flip=False, fingers=5):
    """Nodes of a rig with the model's hands, turned and somewhere in the world: names, parents and positions."""
    nodes = [("Hips", -1, np.zeros(3))]
    for side in sides:
        joints = model_profile(MODEL, side).joints[:, :3] * scale * ([-1, 1, 1] if flip else [1, 1, 1])
        at = np.array([0.7 if side == "left" else -0.7, 1.4, 0.1]) * scale
        placed = at + quat_rotate(TURN, joints)
        wrist = len(nodes)
        nodes.append((hand.format(side=side.capitalize()), 0, placed[1]))
        for word, row in list(zip(WORDS, FINGERS, strict=True))[:fingers]:
            parent = wrist
            for n, k in enumerate(row if word == "Thumb" else row[1:]):
                if n < 3 or tips:
                    nodes.append((name.format(side=side.capitalize(), word=word, n=n + 1), parent, placed[k]))
                    parent = len(nodes) - 1
    return nodes


def write_bvh(path, nodes):
    def joint(n, depth):
        name, parent, place = nodes[n]
        offset = place - (nodes[parent][2] if parent >= 0 else 0.0)
        kind = "ROOT" if parent < 0 else "JOINT"
        lines = [f"{kind} {name}", "{", f"OFFSET {offset[0]} {offset[1]} {offset[2]}", "CHANNELS 0"]
        below = [k for k, (_, above, _) in enumerate(nodes) if above == n]
        for k in below:
            lines += joint(k, depth + 1)
        if not below:
            lines += ["End Site", "{", "OFFSET 0 0 0", "}"]
        return [*lines, "}"]

    text = ["HIERARCHY", *joint(0, 0), "MOTION", "Frames: 1", "Frame Time: 0.01", ""]
    path.write_text("\n".join(text).replace("CHANNELS 0", "CHANNELS 3 Zrotation Xrotation Yrotation"))
    channels = 3 * len(nodes)
    path.write_text(path.read_text() + " ".join(["0"] * channels) + "\n")
    return path


def same_hand(profile, side, atol=5e-4):
    expected = model_profile(MODEL, side).joints
    for row in FINGERS:
        chain = list(row if row is FINGERS[0] else row[1:])
        found = profile.hands[side].joints
        lengths = np.linalg.norm(np.diff(found[chain, :3], axis=0), axis=1)
        np.testing.assert_allclose(lengths, np.linalg.norm(np.diff(expected[chain, :3], axis=0), axis=1), atol=atol)
        np.testing.assert_allclose(found[chain[0], :3], expected[chain[0], :3], atol=atol)
        back = quat_rotate(found[chain[1], 3:], np.array([0.0, 1.0, 0.0]))
        assert back @ quat_rotate(expected[chain[1], 3:], np.array([0.0, 1.0, 0.0])) > 0.98


@pytest.mark.parametrize("name", ["{side}Hand{word}{n}", "mixamorig:{side}Hand{word}{n}"])
def test_a_rig_is_found_wherever_it_stands(tmp_path, name):
    said = []
    file = write_glb(tmp_path / "avatar.glb", rig(name=name))
    profile = import_profile(file, "a", MODEL, said.append)
    for side in SIDES:
        same_hand(profile, side)
        assert any(line.startswith(f"{side}: hand bone") for line in said)


def test_a_vrm_file_names_its_bones_itself(tmp_path):
    nodes = [(f"bone{n}", parent, place) for n, (_, parent, place) in enumerate(rig())]
    humanoid = {}
    for n, (name, _, _) in enumerate(rig()):
        for side in ("Left", "Right"):
            if name == f"{side}Hand":
                humanoid[f"{side.lower()}Hand"] = {"node": n}
            for word in WORDS:
                parts = (
                    ("Metacarpal", "Proximal", "Distal") if word == "Thumb" else ("Proximal", "Intermediate", "Distal")
                )
                for k, part in enumerate(parts):
                    if name == f"{side}Hand{word}{k + 1}":
                        humanoid[f"{side.lower()}{word.replace('Pinky', 'Little')}{part}"] = {"node": n}
    file = write_glb(tmp_path / "avatar.vrm", nodes, extensions={"VRMC_vrm": {"humanoid": {"humanBones": humanoid}}})
    same_hand(import_profile(file, "a", MODEL, lambda _: None), "right")


@pytest.mark.parametrize("facing", [1.0, -1.0])
def test_the_bones_of_a_t_pose_are_kept_whichever_way_the_avatar_faces(tmp_path, facing):
    """VRM 1 faces +z in its file, and VRM 0 faces -z; in a profile, everybody faces +z."""
    nodes, expected = [("Hips", -1, np.zeros(3))], {}
    for side, along in zip(SIDES, (1.0, -1.0), strict=True):
        palm = np.array([[0.0, 0.0, -along], [0.0, 1.0, 0.0], [along, 0.0, 0.0]])
        expected[side] = model_profile(MODEL, side).joints[:, :3] @ palm.T
        yaw, at = np.array([facing, 1.0, facing]), np.array([0.7 * along, 1.4, 0.1])
        elbow = len(nodes)
        nodes.append((f"{side.capitalize()}ForeArm", 0, yaw * (at + np.array([-0.24 * along, 0.01, 0.0]))))
        nodes.append((f"{side.capitalize()}Hand", elbow, yaw * at))
        for word, row in zip(WORDS, FINGERS, strict=True):
            parent = elbow + 1
            for n, k in enumerate(row if word == "Thumb" else row[1:]):
                nodes.append((f"{side.capitalize()}Hand{word}{n + 1}", parent, yaw * (at + expected[side][k])))
                parent = len(nodes) - 1
    profile = import_profile(write_glb(tmp_path / "a.glb", nodes), "a", MODEL, lambda _: None)
    bones = [k for row in FINGERS for k in (row if row is FINGERS[0] else row[1:])]
    for side, along in zip(SIDES, (1.0, -1.0), strict=True):
        t_pose, elbow = profile.hands[side].t_pose, profile.hands[side].elbow
        assert t_pose is not None
        assert elbow is not None
        np.testing.assert_allclose(t_pose[bones], expected[side][bones], atol=1e-6)
        np.testing.assert_allclose(elbow, [-0.24 * along, 0.01, 0.0], atol=1e-6)


def test_a_rig_in_another_pose_has_no_t_pose(tmp_path):
    profile = import_profile(write_glb(tmp_path / "a.glb", rig()), "a", MODEL, lambda _: None)
    assert all(profile.hands[side].t_pose is None for side in SIDES)


@pytest.mark.parametrize(("scale", "unit"), [(1.0, "metres"), (100.0, "centimetres"), (10.0, "decimetres")])
def test_the_unit_of_a_bvh_file_is_guessed_and_said(tmp_path, scale, unit):
    said = []
    profile = import_profile(write_bvh(tmp_path / "a.bvh", rig(scale)), "a", MODEL, said.append)
    same_hand(profile, "left")
    assert any(unit in line for line in said)


def test_the_bone_map_of_the_clients_adds_to_the_names(tmp_path):
    nodes = [
        (name.replace("Index", "Zeige").replace("RightHand", "R.Tatze"), parent, place) for name, parent, place in rig()
    ]
    table = {f"Left{part}": f"LeftHandZeige{n}" for n, part in ((1, "HandIndex1"), (2, "IndexIntermediate"))}
    table |= {"index_03_l": "LeftHandZeige3", "RightHand": "R.Tatze"}
    for word, name in zip(WORDS, ("Thumb", "Zeige", "Middle", "Ring", "Pinky"), strict=True):
        table |= {f"RightHand{word}{n}": f"R.Tatze{name}{n}" for n in (1, 2, 3)}
    (tmp_path / "map.json").write_text(json.dumps(table))
    rigged = write_glb(tmp_path / "a.glb", nodes)
    profile = import_profile(rigged, "a", MODEL, lambda _: None, tmp_path / "map.json")
    plain = import_profile(write_glb(tmp_path / "b.glb", rig(tips=False)), "b", MODEL, lambda _: None)
    for side in SIDES:
        bones = [k for row in FINGERS for k in row[:-1]]
        heads, expected = (each.hands[side].joints[bones, :3] for each in (profile, plain))
        np.testing.assert_allclose(heads, expected, atol=1e-3)
    for wrong, said in (({"LeftToe": "R.Tatze"}, "not a name"), ({"LeftHand": "Tatze"}, "no bone 'Tatze'")):
        (tmp_path / "map.json").write_text(json.dumps(wrong))
        with pytest.raises(RigFileError, match=said):
            import_profile(rigged, "a", MODEL, lambda _: None, tmp_path / "map.json")


def test_a_map_by_hand_replaces_the_names(tmp_path):
    nodes = [(f"b{n}", parent, place) for n, (_, parent, place) in enumerate(rig(sides=("right",)))]
    joints = ["wrist"]
    joints += [f"thumb_{part}" for part in ("metacarpal", "proximal", "distal", "tip")]
    joints += [
        f"{f}_{p}" for f in ("index", "middle", "ring", "little") for p in ("proximal", "intermediate", "distal", "tip")
    ]
    table = {"right": {joint: f"b{n + 1}" for n, joint in enumerate(joints)}}
    (tmp_path / "map.json").write_text(json.dumps(table))
    profile = import_profile(write_glb(tmp_path / "a.glb", nodes), "a", MODEL, lambda _: None, tmp_path / "map.json")
    same_hand(profile, "right")
    for wrong, reason in (
        ({"right": {"elbow": "b1"}}, "no joint 'elbow'"),
        ({"right": {"wrist": "x"}}, "no bone 'x'"),
        ({}, "must be"),
        ({"right": {"thumb_tip": "b1"}}, "no wrist"),
    ):
        (tmp_path / "map.json").write_text(json.dumps(wrong))
        with pytest.raises(RigFileError, match=reason):
            import_profile(tmp_path / "a.glb", "a", MODEL, lambda _: None, tmp_path / "map.json")


def test_a_hand_without_bones_at_its_tips_is_guessed_and_said(tmp_path):
    said = []
    import_profile(write_glb(tmp_path / "a.glb", rig(tips=False)), "a", MODEL, said.append)
    assert sum("guessed" in line for line in said) == 10


def test_three_fingers_are_enough(tmp_path):
    profile = import_profile(write_glb(tmp_path / "a.glb", rig(fingers=3)), "a", MODEL, lambda _: None)
    assert np.isnan(profile.hands["left"].joints[list(FINGERS[4]), 0]).all()


@pytest.mark.parametrize(
    ("nodes", "reason"),
    [
        (rig(name="x{side}{word}{n}x"), "no finger bones are recognised"),
        (rig(flip=True), "mirrored"),
        (rig(scale=0.01), "multiply its positions by 100"),
    ],
    ids=["without fingers", "mirrored", "scale 0.01"],
)
def test_a_rig_that_cannot_be_used_is_refused_with_the_remedy(tmp_path, nodes, reason):
    with pytest.raises((RigFileError, ProfileError), match=reason):
        import_profile(write_glb(tmp_path / "a.glb", nodes), "a", MODEL, lambda _: None)


@pytest.mark.parametrize(
    ("name", "content"), [("a.fbx", b""), ("a.glb", b"nothing"), ("a.bvh", b"nothing"), ("b.glb", None)]
)
def test_a_file_that_cannot_be_read_is_named(tmp_path, name, content):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(RigFileError, match=name):
        import_profile(tmp_path / name, "a", MODEL, lambda _: None)


def test_the_command_writes_a_profile_and_a_picture(tmp_path, capsys):
    file, out = write_glb(tmp_path / "my avatar.glb", rig()), tmp_path / "hand.json"
    assert main(["hand", "import", str(file), "--out", str(out)]) == 0
    assert read_profile(out).name == "my-avatar"
    assert out.with_suffix(".png").stat().st_size > 10_000
    assert "hand bone LeftHand" in capsys.readouterr().out
    assert main(["hand", "show", str(tmp_path / "absent.json"), "--out", str(tmp_path / "x.png")]) == 1
    assert "cannot be read" in capsys.readouterr().err


def test_the_command_leaves_the_picture_out(tmp_path):
    file, out = write_glb(tmp_path / "a.glb", rig()), tmp_path / "hand.json"
    out.with_suffix(".png").write_bytes(b"another one's")
    assert main(["hand", "import", str(file), "--no-picture", "--out", str(out)]) == 0
    assert read_profile(out).name == "a"
    assert out.with_suffix(".png").read_bytes() == b"another one's"
