"""`manipnet import`: small samples in the format of each set become takes that training reads."""

import json
import pickle
import re
import zipfile
from pathlib import Path

import numpy as np
import pytest
from other_joints import HAND, angles_at, hand_joints, object_poses, times_s, wrist_at, write_box
from scipy.spatial.transform import Rotation

from manipnet.geometry import SIDES, Side, mirror_points, mirror_poses, quat_to_matrix
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet_tools import cli
from manipnet_tools.importing.joint_names import recognised
from manipnet_tools.importing.plain_values import Named, plain_values
from manipnet_tools.importing.retarget import fit_hand, model_joints
from manipnet_tools.importing.source import ImportingError
from manipnet_tools.takes.dataset import take_folders
from manipnet_tools.takes.sources import licence_of, read_sources
from manipnet_tools.takes.take import Take, read_take
from manipnet_tools.training.dataset import load_captured_hands

SECONDS, SIZE = 2.0, 1.06
Z_UP = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
"""Turns a world with Y up into one with Z up."""


def matrices(poses: np.ndarray) -> np.ndarray:
    result = np.tile(np.eye(4), (len(poses), 1, 1))
    result[:, :3, :3], result[:, :3, 3] = Z_UP @ quat_to_matrix(poses[:, 3:]), poses[:, :3] @ Z_UP.T
    return result


def write_taco(root: Path, sequence: str = "(stir, spoon, bowl)/20231105_019", seconds: float = SECONDS) -> Path:
    """A sequence in which the right hand holds the tool and the left hand the target."""
    t_s = times_s(seconds, 30.0)
    joints = np.stack([hand_joints(side, t_s, SIZE) for side in ("left", "right")], axis=1) @ Z_UP.T
    (root / "Hand_Poses_3D" / sequence).mkdir(parents=True)
    np.save(root / "Hand_Poses_3D" / sequence / "hand_joints.npy", joints.astype(np.float32))
    objects = root / "Object_Poses" / sequence
    objects.mkdir(parents=True)
    np.save(objects / "tool_051.npy", matrices(object_poses("right", t_s)).astype(np.float32))
    np.save(objects / "target_017.npy", matrices(object_poses("left", t_s)))
    models = root / "Object_Models"
    models.mkdir(exist_ok=True)
    write_box(models / "051_cm.obj", 2.0)
    write_box(models / "017_cm.obj", 3.0)
    return root


def check_fingers(take: Take, side: Side, size: float, tolerance_m: float, tip_tolerance_m: float = 0.012) -> None:
    """The joints are those of the other hand, as far as a hand of another size can be there."""
    expected = hand_joints(side, take.time_s, size)
    found = take.fingers[side].positions[:, model_joints(HAND)]
    distances = np.linalg.norm(found - expected, axis=2)[:, 2:]
    assert np.median(distances) < tolerance_m
    assert np.linalg.norm(found[:, [8, 12, 16, 20]] - expected[:, [8, 12, 16, 20]], axis=2).mean() < tip_tolerance_m


def test_taco_becomes_takes_that_training_reads(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = tmp_path / "data"
    assert cli.main(["import", "taco", str(write_taco(tmp_path / "taco")), "--out", str(data)]) == 0
    assert "median distance of the joints left hand" in capsys.readouterr().err
    (folder,) = take_folders(data)
    take = read_take(folder)
    assert (folder.name, take.rate_hz, set(take.objects)) == ("taco_20231105_019", 120.0, {"taco_051", "taco_017"})
    assert len(take.time_s) == 241
    for side in SIDES:
        check_fingers(take, side, SIZE, 0.006)
    np.testing.assert_allclose(
        take.bodies["taco_051"].poses[::4], object_poses("right", times_s(SECONDS, 30.0)), atol=2e-5
    )
    hands = {hand.name: hand for hand in load_captured_hands(data)}
    assert {name: hand.shape.name for name, hand in hands.items()} == {
        "taco_20231105_019/right": "taco_051",
        "taco_20231105_019/left": "taco_017",
    }
    assert hands["taco_20231105_019/right"].shape.volume_m3 == pytest.approx(0.04**3)
    source = read_sources(data)[folder.name]
    assert (source.licence, source.original) == ("CC BY 4.0", "(stir, spoon, bowl)/20231105_019")
    assert licence_of(data, [folder.name]).startswith("CC BY 4.0; trained on TACO by Yun Liu")
    assert "CC BY-NC 4.0" in licence_of(data, [folder.name, "mug1"])


@pytest.mark.slow
def test_a_model_that_is_trained_on_them_states_their_licence(tmp_path: Path) -> None:
    pytest.importorskip("torch", reason="training needs the train extra")
    from manipnet.synthesis.model.bundle import load_bundle

    data, model = tmp_path / "data", tmp_path / "model"
    assert cli.main(["import", "taco", str(write_taco(tmp_path / "taco", seconds=6.0)), "--out", str(data)]) == 0
    size = ["--training.width=24", "--training.rounds=1", "--training.epochs-per-round=1", "--training.batch=32"]
    assert cli.main(["train", "--data", str(data), "--out", str(model), *size]) == 0
    assert load_bundle(str(model)).meta["licence"].startswith("CC BY 4.0; trained on TACO by Yun Liu")


def test_a_gap_divides_a_take_and_a_short_one_does_not(tmp_path: Path) -> None:
    taco = write_taco(tmp_path / "taco", "(cut, knife, bowl)/a")
    joints = np.load(file := taco / "Hand_Poses_3D/(cut, knife, bowl)/a/hand_joints.npy")
    long = np.concatenate([joints, joints[::-1], joints])
    long[[10, 11]] = np.nan
    long[60:80] = np.nan
    np.save(file, long)
    for path in (taco / "Object_Poses/(cut, knife, bowl)/a").glob("*.npy"):
        np.save(path, np.concatenate([poses := np.load(path), poses[::-1], poses]))
    assert cli.main(["import", "taco", str(taco), "--out", str(tmp_path / "data")]) == 0
    takes = [read_take(folder) for folder in take_folders(tmp_path / "data")]
    assert [(take.name, len(take.time_s)) for take in takes] == [("taco_a-1", 4 * 59 + 1), ("taco_a-2", 4 * 102 + 1)]


def test_takes_are_added_to_a_folder_and_not_written_twice(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    taco, data = write_taco(tmp_path / "taco"), tmp_path / "data"
    write_taco(taco, "(cut, knife, bowl)/b")
    assert cli.main(["import", "taco", str(taco), "--out", str(data), "--only", "(stir*"]) == 0
    assert cli.main(["import", "taco", str(taco), "--out", str(data)]) == 0
    assert "20231105_019 is left out" in capsys.readouterr().err
    assert set(read_sources(data)) == {"taco_20231105_019", "taco_b"} == {path.name for path in take_folders(data)}
    assert cli.main(["import", "taco", str(taco), "--out", str(data), "--only", "(pour*"]) == 1
    assert "--only (pour*: matches none of 2 takes" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda root: (root / "Object_Models/051_cm.obj").unlink(), r"holds no Object_Models/051_cm\.obj"),
        (lambda root: [path.unlink() for path in root.glob("Object_Poses/*/*/*")], "unpack Object_Poses.zip of TACO"),
        (lambda root: _change(root, lambda joints: joints[:, ::-1]), "does not fit: its joints are"),
        (lambda root: _change(root, lambda joints: 10 * joints), "does not fit: its joints are"),
        (lambda root: _change(root, lambda joints: np.roll(joints, 7, axis=2)), "check their order|not in the order"),
        (lambda root: _change(root, lambda joints: joints + np.nan), "no frame with its wrist and knuckles"),
        (lambda root: _change(root, lambda joints: joints[:, :, :16]), r"expected are decimal numbers \(T, 2, 21, 3\)"),
        (lambda root: _change(root, _noise), "mm long: these are not the joints of a hand"),
    ],
)
def test_nonsense_is_refused_with_the_reason(tmp_path: Path, spoil, reason: str, capsys) -> None:
    taco = write_taco(tmp_path / "taco")
    spoil(taco)
    assert cli.main(["import", "taco", str(taco), "--out", str(tmp_path / "data")]) == 1
    printed = " ".join(capsys.readouterr().err.split())
    assert re.search(reason, printed), printed
    assert "could be imported, for the reasons above" in printed


def _change(root: Path, change) -> None:
    (file,) = root.glob("Hand_Poses_3D/*/*/hand_joints.npy")
    np.save(file, change(np.load(file)))


def _noise(joints: np.ndarray) -> np.ndarray:
    return joints + np.random.default_rng(0).normal(0.0, 0.02, joints.shape)


def test_mano_alone_is_refused_with_the_reason(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "taco" / "Hand_Poses").mkdir(parents=True)
    assert cli.main(["import", "taco", str(tmp_path / "taco"), "--out", str(tmp_path / "data")]) == 1
    assert "Hand_Poses holds parameters of MANO" in capsys.readouterr().err


# DexterHand


MANO_ORDER = ("index", "middle", "pinky", "ring", "thumb")


def hand_bvh(
    side: Side, rate_hz: float, name, unit_m: float = 1.0, mirrored: bool = False, seconds: float = SECONDS
) -> str:
    """The model's skeleton, a little larger, as BVH with names of another program; `name(finger, place)`."""
    t_s = times_s(seconds, rate_hz)
    joints = hand_joints(side, t_s, SIZE) / unit_m
    joints = mirror_points(joints) if mirrored else joints
    lines = ["HIERARCHY", f"ROOT {name(None, 0)}", "{", "OFFSET 0 0 0", "CHANNELS 3 Xposition Yposition Zposition"]
    columns = [joints[:, 0]]
    for finger in MANO_ORDER:
        first = 1 + 4 * ("thumb", "index", "middle", "ring", "pinky").index(finger)
        for place in range(3):  # positions alone, which not every skeleton has but every reader of BVH takes
            lines += [f"JOINT {name(finger, place)}", "{", "OFFSET 9 9 9", "CHANNELS 3 Xposition Yposition Zposition"]
            columns.append(joints[:, first + place] - joints[:, 0 if place == 0 else first + place - 1])
        lines += ["End Site", "{", "OFFSET 0 0 0", "}", "}", "}", "}"]
    lines += ["}", "MOTION", f"Frames: {len(t_s)}", f"Frame Time: {1 / rate_hz:.6f}"]
    rows = np.concatenate(columns, axis=1)
    return "\n".join([*lines, *(" ".join(f"{v:.6f}" for v in row) for row in rows)]) + "\n"


def object_bvh(
    side: Side, rate_hz: float, unit_m: float = 1.0, mirrored: bool = False, seconds: float = SECONDS
) -> str:
    poses = object_poses(side, times_s(seconds, rate_hz))
    poses = mirror_poses(poses) if mirrored else poses
    turns = Rotation.from_quat(poses[:, 3:]).as_euler("ZXY", degrees=True)
    rows = np.concatenate([poses[:, :3] / unit_m, turns], axis=1)
    channels = "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
    head = f"HIERARCHY\nROOT prop\n{{\nOFFSET 0 0 0\n{channels}\n}}\n"
    body = "\n".join(" ".join(f"{v:.6f}" for v in row) for row in rows)
    return f"{head}MOTION\nFrames: {len(rows)}\nFrame Time: {1 / rate_hz:.7f}\n{body}\n"


def write_dexterhand(
    root: Path, name: str = "Cuboid_00-fps_60", size=(0.15, 0.04, 0.05), with_bvh: bool = True
) -> Path:
    rate_hz = float(name.rpartition("_")[2])
    root.mkdir(exist_ok=True)
    t_s = times_s(SECONDS, rate_hz)
    poses = object_poses("left", t_s)
    poses[:3, :3] = -1000.0  # not in view at first
    about = {
        "description_string": "about the data",
        "mocap_session_name": name.partition("-")[0],
        "index_init_frame": [0],
        "invalid_point_value": np.array([-1000.0, -1000.0, -1000.0]),
        "object_class": name.partition("_")[0],
        "object_size": list(size),
        "fps": int(rate_hz),
    }
    np.savez(
        root / f"{name}.npz",
        metadata=np.array(about, dtype=object),
        hand_translations=np.zeros((len(t_s), 3)),
        hand_poses=np.zeros((len(t_s), 45)),
        object_translations=poses[:, :3],
        object_orientations_quat_xyzw=poses[:, 3:],
    )
    if with_bvh:
        (root / "bvh").mkdir(exist_ok=True)
        text = hand_bvh("left", rate_hz, lambda finger, place: f"{finger}{place + 1}" if finger else "wrist")
        (root / "bvh" / f"{name}_hand.bvh").write_text(text)
    return root


@pytest.mark.parametrize(
    ("name", "size", "extent"),
    [
        ("Cuboid_00-fps_60", (0.15, 0.04, 0.05), (0.15, 0.04, 0.05)),
        ("Cylinder_01-fps_20", (0.055, 0.16), (0.055, 0.16, 0.055)),
        ("Ring_00-fps_60", (0.1, 0.08, 0.04), (0.1, 0.04, 0.1)),
        ("Prism_00-fps_60", (0.05, 0.16), (0.05, 0.16, 0.0433)),
    ],
)
def test_dexterhand_has_one_hand_and_shapes_of_its_own(tmp_path: Path, name: str, size, extent) -> None:
    data = tmp_path / "data"
    assert (
        cli.main(["import", "dexterhand", str(write_dexterhand(tmp_path / "set", name, size)), "--out", str(data)]) == 0
    )
    (hand,) = load_captured_hands(data)  # the right hand, which was not captured, is left out
    assert hand.mirrored
    np.testing.assert_allclose(np.ptp(hand.shape.mesh.vertices, axis=0), extent, atol=2e-4)
    (folder,) = take_folders(data)
    take = read_take(folder)
    rate_hz = float(name.rpartition("_")[2])
    expected = hand_joints("left", take.time_s + 3 / rate_hz, SIZE)  # from where the object is in view
    found = take.fingers["left"].positions[:, model_joints(HAND)]
    assert np.median(np.linalg.norm(found - expected, axis=2)[:, 2:]) < 0.007
    assert licence_of(data, [folder.name]).startswith("Apache-2.0; trained on DexterHand")


def test_dexterhand_without_joints_says_how_to_make_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = write_dexterhand(tmp_path / "set", with_bvh=False)
    write_dexterhand(root, "RubiksCube_00-fps_20", (0.05,))
    assert cli.main(["import", "dexterhand", str(root), "--out", str(tmp_path / "data")]) == 1
    printed = " ".join(capsys.readouterr().err.split())
    assert "holds parameters of MANO, not joints" in printed
    assert "python -m Dataset.visualize_2bvh" in printed
    assert "the object is not rigid, and takes can only have rigid objects" in printed


def test_an_odd_escape_in_a_pickle_is_text() -> None:
    assert plain_values(b"S'\\i'\n.") == "\\i"


def test_nothing_in_a_pickle_is_run(tmp_path: Path) -> None:
    class Evil:
        def __reduce__(self):
            return Path.touch, (tmp_path / "run",)

    for protocol in range(6):
        value = {"a": [1, 2.5, "text", None, True, (3, 4), ()], 7: {"b": Evil()}, "n": np.float64(2.0)}
        read = plain_values(pickle.dumps(value, protocol))
        assert read["a"] == value["a"]
        assert isinstance(read[7]["b"], Named)
    assert not (tmp_path / "run").exists()
    with pytest.raises(ValueError, match="is damaged"):
        plain_values(b"]a.")


# Gloves


NAMES = {
    "rokoko": lambda side, finger, place: f"{side.title()}Digit{1 + FINGER_ORDER.index(finger)}{_words(finger)[place]}",
    "mixamo": lambda side, finger, place: f"mixamorig:{side.title()}Hand{finger.title()}{place + 1}",
    "unreal": lambda side, finger, place: f"{finger}_0{place + 1}_{side[0]}",
    "anatomy": lambda side, finger, place: f"{side[0].upper()}_{finger}_{_anatomy(finger)[place]}",
    "unity": lambda side, finger, place: f"{side.title()}{finger.title().replace('Pinky', 'Little')}{_unity[place]}",
}
FINGER_ORDER = ("thumb", "index", "middle", "ring", "pinky")
_unity = ("Proximal", "Intermediate", "Distal")


def _words(finger: str) -> tuple[str, ...]:
    return ("Metacarpal", "Proximal", "Distal") if finger == "thumb" else ("Proximal", "Intermediate", "Distal")


def _anatomy(finger: str) -> tuple[str, ...]:
    return ("CMC", "MCP", "IP") if finger == "thumb" else ("MCP", "PIP", "DIP")


@pytest.mark.parametrize("program", NAMES)
@pytest.mark.parametrize(("unit_m", "mirrored"), [(0.01, False), (0.1, True), (0.0254, False)])
def test_glove_takes_in_bvh(tmp_path: Path, program: str, unit_m: float, mirrored: bool) -> None:
    folder = tmp_path / "gloves" / "take one"
    folder.mkdir(parents=True)
    for side in SIDES:

        def name(finger: str | None, place: int, side: Side = side) -> str:
            wrist = {"unreal": f"hand_{side[0]}", "anatomy": f"{side[0].upper()}_wrist"}
            return NAMES[program](side, finger, place) if finger else wrist.get(program, f"{side.title()}Hand")

        (folder / f"{side}.bvh").write_text(hand_bvh(side, 100.0, name, unit_m, mirrored))
    (folder / "Mug.BVH").write_text(object_bvh("right", 100.0, unit_m, mirrored))
    write_box(tmp_path / "mug.obj", 0.04)
    data = tmp_path / "data"
    options = ["--mesh", f"Mug={tmp_path / 'mug.obj'}", "--licence", "our own"]
    assert cli.main(["import", "bvh", str(tmp_path / "gloves"), "--out", str(data), *options]) == 0
    (take_folder,) = take_folders(data)
    take = read_take(take_folder)
    assert (take.name, take.objects) == ("gloves_take_one", ("Mug",))
    for side in SIDES:
        check_fingers(take, side, SIZE, 0.006, 0.016)  # the files have no fingertips
    np.testing.assert_allclose(take.bodies["Mug"].poses, object_poses("right", take.time_s), atol=2e-4)
    assert licence_of(data, [take.name]) == "our own; trained on gloves"


def test_a_take_without_its_mesh_or_object_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "gloves"
    folder.mkdir()
    for side in SIDES:
        (folder / f"{side}.bvh").write_text(
            hand_bvh(
                side,
                100.0,
                lambda finger, place, side=side: NAMES["mixamo"](side, finger, place) if finger else f"{side}Hand",
            )
        )
    run = ["import", "bvh", str(folder), "--out", str(tmp_path / "data")]
    assert cli.main(run) == 1
    assert "has no object; a take for training needs" in " ".join(capsys.readouterr().err.split())
    (folder / "Mug.bvh").write_text(object_bvh("right", 100.0))
    assert cli.main(run) == 1
    assert "the object 'Mug' has no mesh; give --mesh Mug=FILE" in " ".join(capsys.readouterr().err.split())


def test_objects_of_one_name_with_other_meshes_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for take, half in (("a", 0.04), ("b", 0.05)):
        (tmp_path / f"{take}.csv").write_text(table())
        write_box(tmp_path / f"{take}.obj", half)
    run = ["import", "csv", "--out", str(tmp_path / "data")]
    assert cli.main([*run, str(tmp_path / "a.csv"), "--mesh", f"Mug={tmp_path / 'a.obj'}"]) == 0
    assert cli.main([*run, str(tmp_path / "b.csv"), "--mesh", f"Mug={tmp_path / 'b.obj'}"]) == 1
    assert "is another mesh; rename the object Mug" in " ".join(capsys.readouterr().err.split())
    assert [folder.name for folder in take_folders(tmp_path / "data")] == ["a"]


def table_columns(t_s: np.ndarray, sides: tuple[Side, ...] = SIDES) -> dict[str, np.ndarray]:
    """A table in centimetres, with joints named as Rokoko names them, by column."""
    columns: dict[str, np.ndarray] = {"Frame": np.arange(len(t_s)), "Time": t_s + 12.0}
    for side in sides:
        joints = 100 * hand_joints(side, t_s, SIZE)
        names = [f"{side.title()}Hand"]
        names += [f"{side.title()}{f.title()}{p}" for f in FINGER_ORDER for p in (*_words(f), "Tip")]
        for number, name in enumerate(names):
            columns |= {f"{name}_position_{axis}": joints[:, number, i] for i, axis in enumerate("xyz")}
    poses = object_poses("right", t_s)
    columns |= {f"Mug_position_{axis}": 100 * poses[:, i] for i, axis in enumerate("xyz")}
    return columns | {f"Mug_rotation_{axis}": poses[:, 3 + i] for i, axis in enumerate("xyzw")}


def table_text(
    columns: dict[str, np.ndarray], separator: str = ",", decimal: str = ".", drop: slice = slice(0, 0)
) -> str:
    rows = np.delete(np.stack(list(columns.values()), axis=1), np.r_[drop], axis=0)
    lines = [separator.join(columns), *(separator.join(f"{v:.6f}".replace(".", decimal) for v in row) for row in rows)]
    return "\n".join(lines) + "\n"


def table(separator: str = ",", decimal: str = ".", drop: slice = slice(0, 0)) -> str:
    return table_text(table_columns(times_s(SECONDS, 90.0)), separator, decimal, drop)


@pytest.mark.parametrize(
    "text", [table(), table(";", ","), "\ufeff" + table("\t").replace("\n", "\r\n"), table(drop=slice(40, 46))]
)
def test_glove_takes_in_a_table(tmp_path: Path, text: str) -> None:
    path = tmp_path / "grab.csv"
    path.write_bytes(text.encode())
    write_box(tmp_path / "mug.obj", 0.04)
    data = tmp_path / "data"
    assert cli.main(["import", "csv", str(path), "--out", str(data), "--mesh", f"Mug={tmp_path / 'mug.obj'}"]) == 0
    (folder,) = take_folders(data)
    take = read_take(folder)
    for side in SIDES:
        check_fingers(take, side, SIZE, 0.006)
    np.testing.assert_allclose(take.bodies["Mug"].poses, object_poses("right", take.time_s), atol=1e-3)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("Time", "Clock", "has no column time with the seconds of each frame"),
        ("LeftHand_", "LeftIndexProximal_", "two columns are called 'LeftIndexProximal_position_x'"),
        ("LeftThumbTip_", "LeftWrist_", "'LeftHand' and 'LeftWrist' are the same joint of the left hand"),
        ("Left", "", "does not say whether it is left or right"),
        (
            "Proximal",
            "Nothing",
            "the left hand has no knuckle of the index; the joints that are recognised are LeftHand",
        ),
    ],
)
def test_a_bad_table_is_refused_with_the_reason(tmp_path: Path, old: str, new: str, reason: str, capsys) -> None:
    (tmp_path / "grab.csv").write_text(table().replace(old, new))
    assert cli.main(["import", "csv", str(tmp_path / "grab.csv"), "--out", str(tmp_path / "data")]) == 1
    assert reason in " ".join(capsys.readouterr().err.split())


def test_a_hand_under_the_other_name_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    t_s = times_s(SECONDS, 60.0)
    left = {name.replace("Left", "Right"): values for name, values in table_columns(t_s, ("left",)).items()}
    (tmp_path / "grab.csv").write_text(table_text(left | table_columns(t_s, ("left",))))
    assert cli.main(["import", "csv", str(tmp_path / "grab.csv"), "--out", str(tmp_path / "data")]) == 1
    expected = "the joints called right are those of the other hand; exchange left and right"
    assert expected in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    ("names", "joints"),
    [
        (["LeftHand", "LeftHandThumb1", "LeftHandIndex4", "LeftInHandIndex", "LeftForeArm", "Spine"], [0, 1, 8]),
        (["hand_r", "thumb_01_r", "pinky_03_r", "index_metacarpal_r"], [0, 1, 19]),
        (["R_Wrist", "R_Thumb_CMC", "R_Thumb_Tip", "R_Little_DIP"], [0, 1, 4, 19]),
        (["LeftThumbProximal", "LeftThumbIntermediate", "LeftThumbDistal"], [1, 2, 3]),
        (["LeftThumbMetacarpal", "LeftThumbProximal", "LeftThumbDistal"], [1, 2, 3]),
        (["Root", "LeftToeBase", "MidSpine1", "Mug", "Box01"], []),
    ],
)
def test_names_of_joints(names: list[str], joints: list[int]) -> None:
    assert [number for _, number in recognised(names).values()] == joints


# The fit


@pytest.mark.parametrize("side", SIDES)
def test_the_model_itself_is_found_again(side: Side) -> None:
    t_s = times_s(1.0, 30.0)
    fit = fit_hand(hand_joints(side, t_s), side, HAND)
    np.testing.assert_allclose(fit.wrist[:, :3], wrist_at(side, t_s)[:, :3], atol=1e-6)
    np.testing.assert_allclose(fit.angles, angles_at(t_s), atol=2e-3)
    assert np.nanmax(fit.error_m) < 1e-4


def test_angles_stay_inside_the_limits_and_errors_are_reported() -> None:
    t_s = times_s(1.0, 30.0)
    joints = hand_joints("right", t_s, 1.15)
    fit = fit_hand(joints, "right", HAND)
    lower, upper = HAND.limits.T
    assert (fit.angles >= lower - 1e-9).all()
    assert (fit.angles <= upper + 1e-9).all()
    assert 0.002 < np.median(fit.error_m) < 0.015
    positions = forward_kinematics(HAND, fit.angles)[0]
    assert np.isfinite(positions).all()


def test_lost_joints_are_left_out_of_the_fit() -> None:
    t_s = times_s(1.0, 30.0)
    joints = hand_joints("right", t_s)
    joints[:, [4, 8, 19]] = np.nan
    joints[5] = np.nan
    fit = fit_hand(joints, "right", HAND)
    assert np.flatnonzero(~np.isfinite(fit.angles[:, 0])).tolist() == [5]
    assert np.nanmax(fit.error_m) < 1e-3


def test_a_hand_without_knuckles_is_refused() -> None:
    joints = hand_joints("right", times_s(1.0, 30.0))
    joints[:, 9] = np.nan
    with pytest.raises(ImportingError, match="the right hand has no frame with its wrist and knuckles"):
        fit_hand(joints, "right", HAND)


def test_sources_are_kept_as_a_file_that_people_can_read(tmp_path: Path) -> None:
    assert cli.main(["import", "taco", str(write_taco(tmp_path / "taco")), "--out", str(tmp_path / "data")]) == 0
    (entry,) = json.loads((tmp_path / "data" / "sources.json").read_text())["takes"].values()
    assert entry["url"] == "https://taco2024.github.io"
    assert set(entry["error_mm"]) == set(SIDES)


def test_a_damaged_session_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    root = write_dexterhand(tmp_path / "set")
    (file,) = root.glob("*.npz")
    file.write_bytes(file.read_bytes()[:200])
    with zipfile.ZipFile(root / "Plate_00-fps_20.npz", "w") as archive:
        archive.writestr("readme.txt", "nothing")
    assert cli.main(["import", "dexterhand", str(root), "--out", str(tmp_path / "data")]) == 1
    printed = " ".join(capsys.readouterr().err.split())
    assert "cannot be read" in printed
    assert "is not a session of DexterHand; it holds no metadata" in printed
