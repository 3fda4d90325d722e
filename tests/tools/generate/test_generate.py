"""`manipnet generate` from the command line to takes that training and evaluation read."""

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="needs the extra generate")
pytest.importorskip("manifold3d", reason="needs the extra generate")

from manipnet.synthesis.objects.shape import load_shape
from manipnet_tools.cli import main
from manipnet_tools.evaluation import metrics
from manipnet_tools.generate.job import make_take
from manipnet_tools.takes.dataset import mesh_file, take_folders
from manipnet_tools.takes.sources import licence_of
from manipnet_tools.takes.take import TakeError, read_take
from manipnet_tools.takes.take_file import read_take_file
from manipnet_tools.training.dataset import load_captured_hands, samples_at

pytestmark = pytest.mark.slow
SEED = 4


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("generated") / "set"
    assert main(["generate", "--out", str(folder), "--hours", "0.016", "--seed", str(SEED), "--jobs", "2"]) == 0
    return folder


def test_a_take_is_the_same_whichever_process_makes_it(data: Path):
    take, _ = read_take_file(data / "takes" / "generated-00001")
    again = make_take(1, SEED).take
    for side in ("left", "right"):
        assert np.allclose(take.angles[side], again.angles[side], atol=1e-6)
        assert np.allclose(take.wrists[side], again.wrists[side], atol=1e-6)
    assert np.allclose(take.object, again.object, atol=1e-6)


def test_a_set_is_continued_where_it_was_left(data: Path):
    first, second = (data / "takes" / f"generated-{k:05d}" / "take.npz" for k in (0, 1))
    kept, made = first.stat().st_mtime_ns, second.read_bytes()
    second.unlink()
    assert main(["generate", "--out", str(data), "--hours", "0.016", "--seed", str(SEED), "--jobs", "1"]) == 0
    assert first.stat().st_mtime_ns == kept
    with np.load(second) as now:
        assert len(now["T_world_object"]) > 0
    assert abs(len(second.read_bytes()) - len(made)) < 200


def test_another_seed_does_not_mix_with_a_set(data: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["generate", "--out", str(data), "--seed", "5"]) == 1
    assert "write to another folder" in capsys.readouterr().err


def test_a_folder_with_other_files_is_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    (tmp_path / "letter.txt").write_text("private")
    assert main(["generate", "--out", str(tmp_path)]) == 1
    assert "is not empty" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["letter.txt"]


def test_held_objects_are_touched_and_not_entered(data: Path):
    for folder in take_folders(data):
        take, (written, hand) = read_take(folder), read_take_file(folder)
        shape = load_shape(mesh_file(data, written.object_name))
        for event in written.notes["events"]:
            if event["event"] == "near":
                continue
            middle = int(0.5 * (event["start_s"] + event["end_s"]) * written.rate_hz)
            joints = take.fingers[event["side"]].positions[[middle]]
            gaps = metrics.capsule_gaps(hand, joints, written.object[[middle]], shape).gap[0]
            assert gaps.min() > -0.012, (folder.name, event)
            assert np.sum(gaps < 0.006) >= 3, (folder.name, event)


def test_hands_stay_inside_their_limits_and_move_smoothly(data: Path):
    for folder in take_folders(data):
        take, hand = read_take_file(folder)
        for side in ("left", "right"):
            assert (take.angles[side] >= hand.limits[:, 0] - 1e-5).all()
            assert (take.angles[side] <= hand.limits[:, 1] + 1e-5).all()
            steps = np.linalg.norm(np.diff(take.wrists[side][:, :3], axis=0), axis=1)
            assert steps.max() * take.rate_hz < 6.0, "no wrist jumps"
            quats = take.wrists[side][:, 3:]
            turns = 2.0 * np.arccos(np.clip(np.abs(np.sum(quats[1:] * quats[:-1], axis=1)), 0.0, 1.0))
            assert turns.max() * take.rate_hz < 40.0, "no wrist turns at once"
            assert np.abs(np.diff(take.angles[side], axis=0)).max() * take.rate_hz < 30.0


def test_training_reads_the_takes_with_their_own_hands_and_free_terms(data: Path):
    names = [folder.name for folder in take_folders(data)]
    assert licence_of(data, names).startswith("Apache-2.0")
    assert "ManipNet dataset" not in licence_of(data, names)
    hands = load_captured_hands(data, names)
    assert [hand.name for hand in hands] == [f"{name}/{side}" for name in names for side in ("right", "left")]
    _, own = read_take_file(data / "takes" / names[1])
    assert np.allclose(hands[2].hand.offsets, own.offsets)
    take, _ = read_take_file(data / "takes" / names[0])
    assert np.allclose(hands[0].angles, take.angles["right"], atol=2e-3)
    frames = np.array([200, 400])
    samples = samples_at(hands[0], frames, hands[0].angles[frames], hands[0].angles[frames + 2])
    assert np.isfinite(samples.inputs).all()
    assert np.isfinite(samples.outputs).all()


def test_statistics_and_pictures_are_written(data: Path):
    found = json.loads((data / "statistics.json").read_text())
    assert found["takes"] == 2
    assert found["hours"] > 0.015
    assert found["verified_per_cpu_hour"] > 0
    assert sum(found["grasps"]["verified"].values()) <= sum(found["grasps"]["found"].values())
    assert (data / "grasps.png").stat().st_size > 10_000
    assert len((data / "grasps.txt").read_text().splitlines()) > 2


def test_a_damaged_take_is_named(tmp_path: Path):
    folder = tmp_path / "takes" / "one"
    folder.mkdir(parents=True)
    (folder / "take.npz").write_bytes(b"PK\x03\x04 nothing")
    with pytest.raises(TakeError, match=r"one.take\.npz: is not a generated take"):
        read_take(folder)
