"""Timecode on its whole way: a fake Motive, a real server's messages, its recording, and every export of that."""

import csv
import json
import struct
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from fake_motive import FakeMotive
from live_server import LiveServer, Subscriber, scene, serving
from natnet_writer import Body, Frame
from osc_writer import bundle, osc

from manipnet.inputs.osc.assembler import FrameAssembler
from manipnet.inputs.osc.packet import split_packet
from manipnet.recording.mcap_file import read_bodies
from manipnet.wire import HandsMessage
from manipnet_tools import cli
from manipnet_tools.commands.replay import resample, take_frames
from manipnet_tools.takes.take import read_take

HZ, TIMECODE_HZ, SECONDS, START_S = 120, 25, 5.0, 7_000.0
NAMES = {1: "left_wrist", 2: "right_wrist", 3: "Box"}


def packed(since_s: float) -> int:
    """The timecode of an instant, which begins at 10:59:58:00, as NatNet packs it."""
    frames = int(since_s * TIMECODE_HZ + 1e-6) + TIMECODE_HZ * (10 * 3600 + 59 * 60 + 58)
    seconds, frame = divmod(frames, TIMECODE_HZ)
    return seconds // 3600 << 24 | seconds // 60 % 60 << 16 | seconds % 60 << 8 | frame


def text(since_s: float) -> str:
    return ":".join(f"{part:02d}" for part in packed(since_s).to_bytes(4, "big"))


def stream(motive: FakeMotive) -> None:
    begin_s = time.monotonic()
    for n in range(round(SECONDS * HZ)):
        time.sleep(max(begin_s + n / HZ - time.monotonic(), 0.0))
        bodies = [Body(id, scene(n / HZ)[name][:3], scene(n / HZ)[name][3:]) for id, name in NAMES.items()]
        motive.send(Frame(n, bodies, START_S + n / HZ, timecode=packed(n / HZ)).write(motive.version))


@pytest.fixture(scope="module")
def performed(tiny_bundle: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[list, Path]]:
    """The hands messages of a performance, and its recording."""
    takes = tmp_path_factory.mktemp("takes")
    with FakeMotive((3, 1), NAMES) as motive:
        options = ("--mesh", "Box=cube", "--model", str(tiny_bundle), "--takes", str(takes), "--look-ahead", "0.1")
        with serving(*options, "--natnet", f"127.0.0.1:{motive.port}") as server:
            motive.wait_for(12)
            yield perform(server, motive), next(takes.glob("*.mcap"))


def perform(server: LiveServer, motive: FakeMotive) -> list[HandsMessage]:
    subscriber = Subscriber(server.addresses["hands"])
    streaming = threading.Thread(target=stream, args=(motive,))
    streaming.start()
    subscriber.until(START_S + 0.5)
    server.ask({"op": "record"})
    messages = subscriber.until(START_S + SECONDS - 0.5)
    server.ask({"op": "stop_recording"})
    streaming.join()
    subscriber.close()
    return messages


def test_messages_have_the_timecode_of_their_instant(performed: tuple[list[HandsMessage], Path]) -> None:
    messages, _ = performed
    assert [m.timecode for m in messages] == [text(m.t_capture - START_S) for m in messages]
    assert {m.timecode_rate for m in messages[-30:]} == {TIMECODE_HZ}, "known after two seconds"


def test_a_recording_keeps_it_and_a_replay_sends_it_again(performed: tuple[list[HandsMessage], Path]) -> None:
    _, recording = performed
    frames = list(read_bodies(recording))
    assert [frame.timecode for frame in frames] == [text(frame.t_s - START_S) for frame in frames]
    take = read_take(recording)
    assert take.timecode is not None
    assert take.timecode.rate == TIMECODE_HZ
    assert [frame.timecode for frame in take_frames(take)] == list(take.timecode.texts)
    for frame in take_frames(resample(take, 240.0)):
        assert frame.timecode in (
            text(frames[0].t_s - START_S + frame.t_s),
            text(frames[0].t_s - START_S + frame.t_s - 1 / 60),
        )
        assert frame.timecode_rate == TIMECODE_HZ


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def first_s(recording: Path) -> float:
    """When the recording begins, since the start of the performance."""
    return next(read_bodies(recording)).t_s - START_S


def check_rows(table: list[dict[str, str]], begin_s: float) -> None:
    assert len(table) > 60
    for row in table:
        assert row["timecode"] == text(begin_s + float(row["time_s"]))
        assert float(row["timecode_rate"]) == TIMECODE_HZ


def test_the_table_of_a_recording_has_it_in_each_row(
    performed: tuple[list[HandsMessage], Path], tmp_path: Path
) -> None:
    _, recording = performed
    assert cli.main(["export", str(recording), "--format", "csv", "--out", str(tmp_path / "take.csv")]) == 0
    check_rows(rows(tmp_path / "take.csv"), first_s(recording))


def test_synthesised_fingers_have_it_too(
    performed: tuple[list[HandsMessage], Path], tiny_bundle: Path, tmp_path: Path
) -> None:
    _, recording = performed
    made = tmp_path / "fingers.npz"
    options = ["--look-ahead", "0.1", "--model", str(tiny_bundle), "--out", str(made)]
    assert cli.main(["synthesize", str(recording), *options]) == 0
    with np.load(made, allow_pickle=False) as arrays:
        assert len(arrays["timecode"]) == len(arrays["time"])
        assert arrays["timecode_rate"] == TIMECODE_HZ
    assert cli.main(["export", str(made), "--format", "csv", "--out", str(tmp_path / "fingers.csv")]) == 0
    check_rows(rows(tmp_path / "fingers.csv"), first_s(recording))


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_the_animation_of_a_gltf_file_begins_with_it(
    performed: tuple[list[HandsMessage], Path], tmp_path: Path, suffix: str
) -> None:
    _, recording = performed
    out = tmp_path / f"take{suffix}"
    assert cli.main(["export", str(recording), "--format", "gltf", "--out", str(out)]) == 0
    data = out.read_bytes()
    document = json.loads(data[20 : 20 + struct.unpack_from("<I", data, 12)[0]] if suffix == ".glb" else data)
    (animation,) = document["animations"]
    expected = {"timecode": text(first_s(recording)), "timecode_time_s": 0.0, "timecode_rate": TIMECODE_HZ}
    assert animation["extras"] == expected


def test_a_bridge_over_osc_gives_timecode_and_rate() -> None:
    assembler = FrameAssembler("osc:test")
    pose = (0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    frames = []
    for k in range(4 * TIMECODE_HZ):
        code = osc("/frame/timecode", packed(k / TIMECODE_HZ), 0)
        datagram = bundle(osc("/frame/timestamp", 40.0 * k), code, osc("/rigidbody/1/transformation", *pose))
        frames += assembler.add(split_packet(datagram), 50.0 + k / TIMECODE_HZ).frames
    assert [frame.timecode for frame in frames] == [text(k / TIMECODE_HZ) for k in range(4 * TIMECODE_HZ)]
    assert [frames[0].timecode_rate, frames[-1].timecode_rate] == [None, TIMECODE_HZ]
