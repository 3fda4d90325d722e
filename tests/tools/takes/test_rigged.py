"""Takes to which a calibrated rig is applied: their fingers are those of the true wrists and props."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from live_server import scene

from manipnet.geometry import Array, compose, invert, quat_exp
from manipnet.recording.mcap_file import RecordingWriter
from manipnet.wire.bodies import BodyFrame, BodySample
from manipnet_tools import cli
from manipnet_tools.takes.rigged import read_rig, read_rigged
from manipnet_tools.takes.take import TakeError

OFFSETS = {
    "left_wrist": np.concatenate([[0.03, -0.02, 0.05], quat_exp(np.array([0.4, -1.2, 0.3]))]),
    "right_wrist": np.concatenate([[-0.01, 0.04, 0.02], quat_exp(np.array([-0.8, 0.5, 2.0]))]),
    "Box": np.concatenate([[0.0, -0.06, 0.01], quat_exp(np.array([0.0, 1.5, 0.0]))]),
}
"""T_body_part."""
BODIES = {"left_wrist": "LW", "right_wrist": 7, "Box": "Prop 1"}
SIZE = 0.9


def rig_text() -> str:
    wrists = "\n".join(
        f"bodies.{part} = {{ body = {BODIES[part]!r}, {_offset(OFFSETS[part])} }}"
        for part in ("left_wrist", "right_wrist")
    )
    place = _offset(OFFSETS["Box"]).replace(", rotation", "\nrotation")
    return f'hand_scale = {SIZE}\n{wrists}\n[[objects]]\nbody = "Prop 1"\nname = "Box"\nmesh = "cube"\n{place}\n'


def _offset(offset: Array) -> str:
    return f"position = {offset[:3].tolist()}, rotation = {offset[3:].tolist()}"


def write(path: Path, body: Callable[[str, Array], BodySample], about: dict[str, str] | None = None) -> Path:
    """A recording of the bodies alone, 1.5 s of `scene`."""
    with RecordingWriter(path, about or {}) as writer:
        for k in range(180):
            poses = {str(name): np.array(pose) for name, pose in scene(k / 120).items()}
            bodies = tuple(body(name, pose) for name, pose in poses.items())
            writer.write_bodies(BodyFrame(k / 120, k, bodies, 0.0, "test"), k * 8_333_333)
    return path


def truth(part: str, pose: Array) -> BodySample:
    return BodySample(None, part, tuple(pose[:3]), tuple(pose[3:]), True)


def tracked(part: str, pose: Array) -> BodySample:
    """The tracked body to which a part is attached."""
    T_world_body = compose(pose, invert(OFFSETS[part]))
    key = BODIES[part]
    number, name = (key, None) if isinstance(key, int) else (None, key)
    return BodySample(number, name, tuple(T_world_body[:3]), tuple(T_world_body[3:]), True)


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    path = tmp_path / "stage.toml"
    path.write_text(rig_text())
    return path


def fingers(take: Path, out: Path, model: Path, *more: str) -> dict[str, np.ndarray]:
    assert cli.main(["synthesize", str(take), "--out", str(out), "--model", str(model), *more]) == 0
    with np.load(out) as file:
        return dict(file)


@pytest.mark.slow
def test_a_calibrated_take_has_the_fingers_of_its_true_wrists(rig: Path, tmp_path: Path, tiny_bundle: Path) -> None:
    sized = tmp_path / "sized.toml"
    sized.write_text(f'hand_scale = {SIZE}\n[bodies]\nleft_wrist = "left_wrist"\nright_wrist = "right_wrist"\n')
    mesh = f"--mesh=Box={Path(read_rig(rig).meshes['Box'].path)}"  # type: ignore[union-attr]
    true = fingers(write(tmp_path / "true.mcap", truth), tmp_path / "a.npz", tiny_bundle, mesh, f"--rig={sized}")
    raw = write(tmp_path / "raw.mcap", tracked)
    given = fingers(raw, tmp_path / "b.npz", tiny_bundle, f"--rig={rig}")
    kept = write(tmp_path / "kept.mcap", tracked, {"rig": rig.read_text()})
    known = fingers(kept, tmp_path / "c.npz", tiny_bundle, mesh)
    for side in ("left", "right"):
        for what in ("positions", "rotations", "distances"):
            name = f"{side}_{what}"
            assert np.ptp(true[name][..., 0]) > 0.0
            np.testing.assert_allclose(given[name], true[name], atol=1e-7)
            np.testing.assert_array_equal(known[name], given[name])
    length = np.linalg.norm(np.diff(true["right_positions"][0, :2], axis=0))
    full = fingers(tmp_path / "true.mcap", tmp_path / "d.npz", tiny_bundle, mesh)
    assert length == pytest.approx(SIZE * np.linalg.norm(np.diff(full["right_positions"][0, :2], axis=0)))
    assert cli.main(
        ["batch", str(tmp_path), "--out", str(tmp_path / "out"), f"--rig={rig}", f"--model={tiny_bundle}", "--jobs=1"]
    )
    with np.load(tmp_path / "out" / "raw.npz") as file:
        np.testing.assert_array_equal(file["right_positions"], given["right_positions"])


def test_a_body_that_the_rig_names_and_the_take_lacks_is_named(rig: Path, tmp_path: Path) -> None:
    take = write(tmp_path / "true.mcap", truth)
    with pytest.raises(
        TakeError, match=r"stage\.toml: bodies\.left_wrist is 'LW', but the bodies of true are left_wrist, right_wrist"
    ):
        read_rigged(take, read_rig(rig))
    with pytest.raises(TakeError, match=r"there is no actor 'bob'; the actors are actor"):
        read_rig(rig, "bob")
