"""Recordings come back as they were written, whatever happened to the writer or to the file."""

import json
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from manipnet.recording.mcap_file import (
    BODIES,
    HANDS,
    TF,
    RecordingError,
    RecordingWriter,
    read_about,
    read_bodies,
    read_hands,
    recorded_avatars,
    recover,
)
from manipnet.synthesis.objects.library import LIBRARY_FOLDER
from manipnet.wire import BodyPose, HandPose, HandsMessage
from manipnet.wire.bodies import BodyFrame, BodySample

ABOUT = {"model": "tiny", "model_hash": "00ff", "rig": "[bodies]\n"}
MESHES = {"cube.ply": (LIBRARY_FOLDER / "cube.ply").read_bytes()}
START_NS = 1_700_000_000_000_000_000
UNROTATED = (0.0, 0.0, 0.0, 1.0)


def frame(k: int) -> BodyFrame:
    bodies = (
        BodySample(None, "left_wrist", (0.1, 1.0, k / 120), UNROTATED, True),
        BodySample(7, None, (0.0, 0.0, 0.0), UNROTATED, k % 2 == 0),
    )
    return BodyFrame(k / 120, k, bodies, (START_NS + k * 8_333_333) * 1e-9, "recording:take.mcap")


def hands(k: int) -> HandsMessage:
    rotations, joints = np.tile(UNROTATED, (17, 1)), np.tile([0.0, 1.0, 0.0, *UNROTATED], (26, 1))
    hand = HandPose("live", "cube", 1.0, np.full(20, 0.1), rotations, joints[0], joints)
    bodies = (BodyPose(True, joints[1], "cube"),)
    return HandsMessage("session", "actor", k, k / 60, k / 60 + 0.6, 0.5, {"left": hand}, bodies)


def write(path: Path, frames: int = 240) -> Path:
    with RecordingWriter(path, ABOUT, MESHES) as writer:
        for k in range(frames):
            writer.write_bodies(frame(k), START_NS + k * 8_333_333)
            if k % 2 == 0:
                writer.write_hands(hands(k // 2), START_NS + k * 8_333_333)
    return path


def test_what_was_written_comes_back(tmp_path: Path) -> None:
    path = write(tmp_path / "take.mcap")
    about = read_about(path)
    assert about.whole
    assert (about.metadata, about.meshes) == (ABOUT, MESHES)
    assert about.counts == {BODIES: 240, HANDS: 120, TF: 360}
    assert list(read_bodies(path)) == [frame(k) for k in range(240)]
    back = list(read_hands(path))
    assert [message.seq for message in back] == list(range(120))
    assert np.array_equal(back[3].hands["left"].angles, hands(3).hands["left"].angles)


def test_foxglove_finds_its_transforms(tmp_path: Path) -> None:
    path = write(tmp_path / "take.mcap", 4)
    with path.open("rb") as file:
        messages = [(s, c, m) for s, c, m in make_reader(file).iter_messages([TF])]
    schema, channel, first = messages[0]
    assert schema is not None
    assert (schema.name, schema.encoding, channel.message_encoding) == (
        "foxglove.FrameTransforms",
        "jsonschema",
        "json",
    )
    assert json.loads(schema.data)["properties"]["transforms"]["type"] == "array"
    transforms = [t for _, _, m in messages for t in json.loads(m.data)["transforms"]]
    children = {t["child_frame_id"] for t in transforms}
    assert {"left_wrist", "7", "actor/cube", "actor/left/index_tip"} <= children
    assert {t["parent_frame_id"] for t in transforms} == {"world"}
    stamp = json.loads(first.data)["transforms"][0]["timestamp"]
    assert stamp["sec"] * 1_000_000_000 + stamp["nsec"] == first.log_time == START_NS


def test_a_recording_is_never_overwritten(tmp_path: Path) -> None:
    path = write(tmp_path / "take.mcap", 2)
    with pytest.raises(FileExistsError):
        RecordingWriter(path, ABOUT)
    assert read_about(path).whole


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9, 0.999])
def test_a_cut_off_file_opens_and_is_recovered(tmp_path: Path, share: float) -> None:
    path = write(tmp_path / "take.mcap")
    content = path.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(content[: int(share * len(content))])
    frames = list(read_bodies(cut))
    assert [f.bodies for f in frames] == [frame(k).bodies for k in range(len(frames))]
    about = recover(cut, tmp_path / "mended.mcap")
    assert not about.whole
    mended = read_about(tmp_path / "mended.mcap")
    assert mended.whole
    assert (mended.metadata, mended.meshes, mended.counts) == (ABOUT, MESHES, about.counts)
    assert list(read_bodies(tmp_path / "mended.mcap"))[-1].t_s == frames[-1].t_s


def test_damage_in_the_middle_costs_one_chunk(tmp_path: Path) -> None:
    path = write(tmp_path / "take.mcap")
    content = bytearray(path.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 8] = bytes(8)
    path.write_bytes(content)
    frames = list(read_bodies(path))
    assert 150 < len(frames) < 240
    assert frames[-1].frame == 239
    assert not read_about(path).whole


@pytest.mark.parametrize("content", [b"", b"not a recording", b"\x89MCAP0\r\n"])
def test_a_file_that_is_not_a_recording_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "take.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="not a recording"):
        list(read_bodies(path))
    with pytest.raises(RecordingError, match=r"missing\.mcap: cannot be read"):
        read_about(tmp_path / "missing.mcap")


WRITER = """
import itertools, pathlib, sys
sys.path.insert(0, sys.argv[2])
from test_mcap_file import ABOUT, MESHES, RecordingWriter, frame
writer = RecordingWriter(pathlib.Path(sys.argv[1]), ABOUT, MESHES)
for k in itertools.count():
    writer.write_bodies(frame(k), k * 8_333_333)
    print(k, flush=True)
    sys.stdin.readline()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGKILL")
def test_a_killed_writer_loses_less_than_a_second(tmp_path: Path) -> None:
    path = tmp_path / "take.mcap"
    command = [sys.executable, "-c", WRITER, str(path), str(Path(__file__).parent)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1) as writer:
        assert writer.stdin is not None
        assert writer.stdout is not None
        written = 0
        while written < 400:
            written = int(writer.stdout.readline())
            writer.stdin.write("\n")
        writer.send_signal(signal.SIGKILL)
        written = [int(line) for line in writer.stdout][-1:] or [written]
    frames = list(read_bodies(path))
    assert [f.frame for f in frames] == list(range(len(frames)))
    assert written[0] - len(frames) < 120
    assert recover(path, tmp_path / "mended.mcap").meshes == MESHES


def write_with_avatar(path: Path) -> Path:
    with RecordingWriter(path, ABOUT, MESHES) as writer:
        for k in range(120):
            writer.write_hands(hands(k), START_NS + k * 16_666_667)
            if k == 60:
                writer.add_about({"hand long": "{}"})
            if k >= 60:
                writer.write_hands(replace(hands(k), hand="long"), START_NS + k * 16_666_667)
    return path


def test_the_hands_of_an_avatar_have_a_topic_of_their_own(tmp_path: Path) -> None:
    path = write_with_avatar(tmp_path / "take.mcap")
    about = read_about(path)
    assert about.metadata == ABOUT | {"hand long": "{}"}
    assert recorded_avatars(about) == ["long"]
    assert [message.seq for message in read_hands(path)] == list(range(120))
    avatar = list(read_hands(path, "long"))
    assert [(message.seq, message.hand, message.bodies) for message in avatar] == [
        (k, "long", ()) for k in range(60, 120)
    ]
    with path.open("rb") as file:
        frames = [json.loads(m.data)["transforms"] for _, _, m in make_reader(file).iter_messages([TF])]
    assert {"actor/left/index_tip", "actor/long/left/index_tip"} <= {t["child_frame_id"] for f in frames for t in f}


def test_a_cut_off_file_with_an_avatar_is_recovered(tmp_path: Path) -> None:
    content = write_with_avatar(tmp_path / "take.mcap").read_bytes()
    cut, mended = tmp_path / "cut.mcap", tmp_path / "mended.mcap"
    cut.write_bytes(content[: int(0.8 * len(content))])
    recover(cut, mended)
    about = read_about(mended)
    assert about.whole
    assert about.metadata == ABOUT | {"hand long": "{}"}
    assert len(list(read_hands(mended, "long"))) == len(list(read_hands(cut, "long"))) > 10
