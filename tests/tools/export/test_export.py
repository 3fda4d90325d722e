"""Exported files are read back, evaluated by the rules of their format, and checked by other programs."""

import csv
import json
import struct
from pathlib import Path

import numpy as np
import pytest
from npm import run_node

from manipnet.actors.hands_message import hand_poses
from manipnet.actors.transitions import ShownHand
from manipnet.geometry import compose, mirror_points, quat_conjugate, quat_exp, quat_log, quat_multiply, transform
from manipnet.recording.mcap_file import RecordingWriter, mesh_file
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.hand.skin import skinned
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.objects.library import load_library_mesh
from manipnet.synthesis.synthesizer import hand_to_world
from manipnet.wire import BodyPose, HandsMessage, State
from manipnet_tools import cli
from manipnet_tools.export.animation import Animation, ExportError, HandTrack, hand_track, read_animation
from manipnet_tools.export.bvh_out import write_bvh
from manipnet_tools.export.csv_out import write_csv
from manipnet_tools.export.gltf_out import write_gltf
from manipnet_tools.takes.bvh_motion import read_bvh
from manipnet_tools.takes.take import BodyTrack, read_take

HAND = shipped_hand()

FRAMES = 40
SIDES = ("left", "right")


def path_of(rng: np.random.Generator, away_m: float) -> np.ndarray:
    """Poses `(T, 7)` of a body that moves and tumbles."""
    s = np.linspace(0.0, 1.0, FRAMES)[:, None]
    turns = quat_exp(rng.normal(size=3) + 4.0 * s * rng.normal(size=3))
    return np.concatenate([rng.normal(size=3) * 0.2 + [away_m, 1.0, 0.0] + 0.3 * s * rng.normal(size=3), turns], axis=1)


@pytest.fixture(scope="module")
def angles() -> dict[str, np.ndarray]:
    """Angles `(T, 20)` of two hands that move through most of their range."""
    rng = np.random.default_rng(3)
    share = 0.5 + 0.45 * np.sin(np.linspace(0.0, 6.0, FRAMES)[:, None] + rng.uniform(0.0, 6.0, (2, 1, 20)))
    low, high = HAND.limits.T
    return dict(zip(SIDES, low + share * (high - low), strict=True))


@pytest.fixture(scope="module")
def animation(angles: dict[str, np.ndarray]) -> Animation:
    """Two hands and two props, of which one has a mesh."""
    rng = np.random.default_rng(4)
    hands = {}
    for side, away_m in zip(SIDES, (-0.2, 0.2), strict=True):
        positions, rotations = forward_kinematics(HAND, angles[side])
        hands[side] = hand_track(HAND, *hand_to_world(side, path_of(rng, away_m), positions, rotations))
    seen = np.arange(FRAMES) != 7
    objects = {name: BodyTrack(path_of(rng, 0.0), seen) for name in ("Box", "the cup")}
    meshes = {"Box": load_library_mesh("mug")}
    return Animation("juggle", 60.0, 0.5 + np.arange(FRAMES) / 60, hands, objects, meshes)


def largest_angle_rad(a: np.ndarray, b: np.ndarray) -> float:
    """The largest angle between corresponding rotations."""
    return float(np.linalg.norm(quat_log(quat_multiply(quat_conjugate(a), b)), axis=-1).max())


def test_bvh_files_are_read_back_unchanged(animation: Animation, tmp_path: Path) -> None:
    write_bvh(animation, tmp_path / "take")
    take = read_take(tmp_path / "take")
    assert (take.rate_hz, take.objects) == (60.0, ("Box", "the_cup"))
    for side in SIDES:
        positions, rotations = animation.hands[side].world()
        assert largest_angle_rad(take.fingers[side].rotations, rotations) < 1e-4
        assert np.allclose(take.fingers[side].positions, positions, atol=1e-6)
    assert largest_angle_rad(take.bodies["the_cup"].poses[:, 3:], animation.objects["the cup"].poses[:, 3:]) < 1e-4
    with pytest.raises(ExportError, match="already contains BVH files"):
        write_bvh(animation, tmp_path / "take")


def test_a_captured_take_is_read_back_unchanged(manipnet_data: Path, tmp_path: Path) -> None:
    source = manipnet_data / "BVH" / "mug1"
    write_bvh(read_animation(source, HAND), tmp_path / "take")
    before, after = read_take(source), read_take(tmp_path / "take")
    assert (after.rate_hz, after.objects) == (before.rate_hz, before.objects)
    for side in SIDES:
        assert largest_angle_rad(before.fingers[side].rotations, after.fingers[side].rotations) < 1e-4
        assert np.allclose(before.fingers[side].positions, after.fingers[side].positions, atol=2e-6)
    ours, theirs = (
        (folder / "leftHand.bvh").read_text().partition("MOTION")[0] for folder in (tmp_path / "take", source)
    )
    assert [word for word in ours.split() if word.isupper()] == [word for word in theirs.split() if word.isupper()]


def test_bvh_for_other_programs_is_in_right_handed_centimetres(animation: Animation, tmp_path: Path) -> None:
    write_bvh(animation, tmp_path / "blender", right_handed=True)
    for side in SIDES:
        bvh = read_bvh(tmp_path / "blender" / f"{side}Hand.bvh")
        translations, rotations = bvh.local_transforms()
        world = [np.concatenate([translations[:, 0], rotations[:, 0]], axis=1)]
        for j, joint in enumerate(bvh.joints[1:], start=1):
            world.append(compose(world[joint.parent], np.concatenate([translations[:, j], rotations[:, j]], axis=1)))
        assert np.allclose(np.stack(world, axis=1)[..., :3], 100 * animation.hands[side].world()[0][:, :17], atol=1e-3)


class Gltf:
    """A file evaluated by the rules of the glTF specification."""

    def __init__(self, path: Path) -> None:
        content = path.read_bytes()
        length = struct.unpack_from("<I", content, 12)[0]
        self.json = json.loads(content[20 : 20 + length])
        self._bytes = content[28 + length :]

    def accessor(self, index: int) -> np.ndarray:
        accessor = self.json["accessors"][index]
        start = self.json["bufferViews"][accessor["bufferView"]]["byteOffset"]
        kind = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}[accessor["componentType"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[accessor["type"]]
        flat = np.frombuffer(self._bytes, kind, accessor["count"] * width, start)
        values = flat.reshape(-1, width).astype(np.float64)
        return values.reshape(-1, 4, 4).swapaxes(1, 2) if accessor["type"] == "MAT4" else values

    def poses(self, frame: int) -> list[np.ndarray]:
        """World pose `(7,)` of each node at a key frame."""
        nodes = [{"translation": [0, 0, 0], "rotation": [0, 0, 0, 1], **node} for node in self.json["nodes"]]
        animation = self.json["animations"][0]
        for channel in animation["channels"]:
            keys = self.accessor(animation["samplers"][channel["sampler"]]["output"])
            nodes[channel["target"]["node"]][channel["target"]["path"]] = keys[frame]
        world = [np.array([*node["translation"], *node["rotation"]], dtype=np.float64) for node in nodes]
        parents = {child: k for k, node in enumerate(nodes) for child in node.get("children", [])}
        for k in range(len(nodes)):  # parents come before their children in our files
            if k in parents:
                world[k] = compose(world[parents[k]], world[k])
        return world

    def skinned(self, name: str, frame: int) -> np.ndarray:
        """Vertices of a skinned mesh in the world."""
        node = next(n for n in self.json["nodes"] if n["name"] == name and "mesh" in n)
        attributes = self.json["meshes"][node["mesh"]]["primitives"][0]["attributes"]
        vertices, weights = self.accessor(attributes["POSITION"]), self.accessor(attributes["WEIGHTS_0"])
        joints = self.accessor(attributes["JOINTS_0"]).astype(int)
        skin_of = self.json["skins"][node["skin"]]
        bind = self.accessor(skin_of["inverseBindMatrices"])
        poses = self.poses(frame)
        total = np.zeros_like(vertices)
        for slot in range(4):
            local = np.einsum("vij,vj->vi", bind[joints[:, slot]], np.c_[vertices, np.ones(len(vertices))])[:, :3]
            pose = np.stack([poses[skin_of["joints"][joint]] for joint in joints[:, slot]])
            total += weights[:, slot, None] * transform(pose, local)
        return total


@pytest.mark.parametrize("frame", [0, 17, FRAMES - 1])
def test_gltf_skins_the_hands_like_the_kinematics(animation: Animation, angles, tmp_path: Path, frame: int) -> None:
    write_gltf(animation, tmp_path / "juggle.glb")
    gltf = Gltf(tmp_path / "juggle.glb")
    for side in SIDES:
        vertices = skinned(HAND, *forward_kinematics(HAND, angles[side][frame]))
        vertices = mirror_points(vertices) if side == "left" else vertices
        assert np.allclose(
            gltf.skinned(f"{side}_hand", frame), transform(animation.hands[side].wrist[frame], vertices), atol=2e-6
        )
    names = [node["name"] for node in gltf.json["nodes"]]
    for name, body in animation.objects.items():
        assert np.allclose(gltf.poses(frame)[names.index(name)][:3], body.poses[frame, :3], atol=1e-6)
    tips = gltf.poses(frame)[names.index("right_INDEX_TIP")][:3]
    assert np.allclose(tips, animation.hands["right"].world()[0][frame, HAND.joint_names.index("INDEX_TIP")], atol=1e-6)


def test_gltf_faces_point_outward_and_time_starts_at_zero(animation: Animation, tmp_path: Path) -> None:
    write_gltf(animation, tmp_path / "juggle.glb")
    gltf = Gltf(tmp_path / "juggle.glb")
    for mesh in gltf.json["meshes"]:
        primitive = mesh["primitives"][0]
        vertices, normals = (gltf.accessor(primitive["attributes"][key]) for key in ("POSITION", "NORMAL"))
        faces = gltf.accessor(primitive["indices"]).astype(int).reshape(-1, 3)
        a, b, c = np.moveaxis(vertices[faces], 1, 0)
        assert np.einsum("fi,fi->", a, np.cross(b, c)) > 0.0, "a closed mesh turned outward has a positive volume"
        assert np.mean(np.sum(np.cross(b - a, c - a) * normals[faces[:, 0]], axis=1) > 0.0) > 0.98
    times = gltf.accessor(gltf.json["animations"][0]["samplers"][0]["input"])[:, 0]
    assert times[0] == 0.0
    assert np.allclose(np.diff(times), 1 / 60, atol=1e-6)


VALIDATE = """
const validator = require('gltf-validator'), fs = require('fs');
validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[1])), {uri: process.argv[1]})
  .then(report => console.log(JSON.stringify(report)));
"""


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_the_khronos_validator_finds_no_fault(animation: Animation, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"juggle{suffix}"
    write_gltf(animation, path)
    report = run_node(VALIDATE, str(path), packages=("gltf-validator@2.0.0-dev.3.10",))
    issues = report["issues"]
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues["messages"]
    assert report["info"]["hasSkins"]
    assert report["info"]["animationCount"] == 1


def test_trimesh_reads_the_file(animation: Animation, tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    write_gltf(animation, tmp_path / "juggle.glb")
    scene = trimesh.load_scene(tmp_path / "juggle.glb")
    assert {"left_hand", "right_hand", "Box"} <= set(scene.geometry)
    assert len(scene.geometry["right_hand"].faces) == len(HAND.skin.faces)


def test_csv_names_every_number(animation: Animation, angles, tmp_path: Path) -> None:
    write_csv(animation, tmp_path / "juggle.csv")
    with (tmp_path / "juggle.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == FRAMES
    row = rows[7]
    assert (row["frame"], float(row["time_s"])) == ("7", pytest.approx(0.5 + 7 / 60))
    for side in SIDES:
        read = [float(row[f"{side}_{name.lower()}_rad"]) for name in HAND.angle_names]
        assert np.allclose(read, angles[side][7], atol=1e-6)
        joints = animation.hands[side].world()[0][7]
        read = [[float(row[f"{side}_{name.lower()}_{axis}"]) for axis in "xyz"] for name in HAND.joint_names]
        assert np.allclose(read, joints, atol=1e-6)
    read = [float(row[f"the cup_{part}"]) for part in ("x", "y", "z", "qx", "qy", "qz", "qw")]
    assert np.allclose(read, animation.objects["the cup"].poses[7], atol=1e-6)
    assert [float(r["Box_tracked"]) for r in rows[6:9]] == [1.0, 0.0, 1.0]


def test_a_hand_of_another_size_is_exported_at_its_size(animation: Animation, angles, tmp_path: Path) -> None:
    hand = animation.hands["right"]
    small = HandTrack(HAND, hand.wrist, hand.rotations, 0.9 * HAND.offsets, hand.live)
    write_gltf(Animation("small", 60.0, animation.time_s, {"right": small}), tmp_path / "small.glb")
    vertices = 0.9 * skinned(HAND, *forward_kinematics(HAND, angles["right"][5]))
    assert np.allclose(
        Gltf(tmp_path / "small.glb").skinned("right_hand", 5), transform(hand.wrist[5], vertices), atol=2e-6
    )


def message(seq: int, t_s: float, x: float, state: State = "live", actor: str = "ann") -> HandsMessage:
    """A hands message of a half-closed left hand at `x`."""
    shown = ShownHand(state, HAND.limits @ [0.5, 0.5], np.array([x, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]), "Box")
    hands = hand_poses(HAND, {"left": shown}, 0.9)
    pose = np.array([x, 1.1, 0.0, 0.0, 0.0, 0.0, 1.0])
    bodies = (BodyPose(True, pose, "left_wrist"), BodyPose(state == "live", pose, "Box"))
    return HandsMessage("session", actor, seq, t_s, t_s + 0.6, 0.5, hands, bodies)


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Two actors. The animation of the first has a gap and a stretch without tracking; earlier frames come first."""
    cube = load_library_mesh("cube")
    path = tmp_path / "stage.mcap"
    with RecordingWriter(path, {}, {"Box.ply": mesh_file(cube.vertices, cube.faces, 0.5)}) as writer:
        for k in range(10):
            writer.write_hands(message(k, 900.0 + k / 60, 9.0), k * 16_666_667)
        for k in range(60):
            if k not in (20, 21):
                writer.write_hands(message(10 + k, k / 60, k / 100, "hold" if 30 <= k < 35 else "live"), k * 16_666_667)
            writer.write_hands(message(k, k / 60, 5.0, actor="bob"), k * 16_666_667)
    return path


def test_a_recording_is_exported_tick_by_tick(recording: Path, tmp_path: Path, angles) -> None:
    stage = read_animation(recording, HAND)
    assert (len(stage.time_s), stage.rate_hz, list(stage.hands), list(stage.objects)) == (60, 60.0, ["left"], ["Box"])
    hand = stage.hands["left"]
    assert np.flatnonzero(~hand.live).tolist() == [20, 21, 30, 31, 32, 33, 34]
    assert np.allclose(hand.wrist[:, 0], [min(k, 19) / 100 if k in (20, 21) else k / 100 for k in range(60)])
    assert hand.scale == pytest.approx(0.9)
    assert stage.objects["Box"].tracked.sum() == 53
    assert np.ptp(stage.meshes["Box"].vertices) == pytest.approx(0.5 * np.ptp(load_library_mesh("cube").vertices))
    assert read_animation(recording, HAND, "bob").hands["left"].wrist[0, 0] == 5.0
    positions, rotations = forward_kinematics(HAND, HAND.limits @ [0.5, 0.5])
    joints, _ = hand_to_world("left", hand.wrist[3], 0.9 * positions, rotations)
    assert np.allclose(hand.world()[0][3], joints, atol=1e-9)


@pytest.mark.parametrize("form", ["gltf s.glb", "bvh s", "csv s.csv"])
def test_the_command_writes_every_format(
    recording: Path, tmp_path: Path, form: str, capsys: pytest.CaptureFixture[str]
) -> None:
    kind, name = form.split()
    assert cli.main(["export", str(recording), "--format", kind, "--out", str(tmp_path / name)]) == 0
    assert (tmp_path / name).exists()
    printed = " ".join(capsys.readouterr().err.split())
    assert "60 frames at 60 Hz (1.0 s), left, objects Box; left held or at rest in 7 frames" in printed


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["stage.mcap", "--format", "gltf", "--out", "x.fbx"], "must end in .glb or .gltf"),
        (["stage.mcap", "--format", "csv", "--out", "no/x.csv"], "its folder does not exist"),
        (["stage.mcap", "--format", "csv", "--out", "x.csv", "--actor", "eve"], "no actor 'eve'; it has ann, bob"),
        (["stage.mcap", "--format", "csv", "--out", "x.csv", "--right-handed"], "csv is always right-handed"),
        (
            ["stage.mcap", "--format", "gltf", "--out", "x.glb", "--mesh", "Cup=mug"],
            "no object is called 'Cup'; the objects are Box",
        ),
        (["walk.txt", "--format", "csv", "--out", "x.csv"], "holds no fingers; make them first: manipnet synthesize"),
        (["bad.npz", "--format", "csv", "--out", "x.csv"], "is not a file of `manipnet synthesize`"),
        (["other.npz", "--format", "csv", "--out", "x.csv"], "is not a file of `manipnet synthesize`"),
        (["gone.npz", "--format", "csv", "--out", "x.csv"], "cannot be read (No such file"),
    ],
)
def test_the_error_of_a_failed_export_names_the_remedy(
    recording: Path, arguments: list[str], complaint: str, capsys: pytest.CaptureFixture[str], monkeypatch
) -> None:
    monkeypatch.chdir(recording.parent)
    Path("walk.txt").write_text("120\n" + 3 * (",".join(3 * ["0,0,0,1,0,0,0"]) + "\n"))
    Path("bad.npz").write_bytes(b"not a zip")
    np.savez("other.npz", time=np.zeros(3))
    assert cli.main(["export", *arguments]) == 1
    assert complaint in " ".join(capsys.readouterr().err.split())
    assert not Path("x.csv").exists()
