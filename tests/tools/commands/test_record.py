"""`manipnet record` beside a real server, and in the place of one."""

import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from live_server import PATIENCE_S, Sender, Stage, scene
from tracked_bodies import record_scene

from manipnet.common.options import parse_endpoint
from manipnet.recording.mcap_file import (
    BODIES,
    HANDS,
    RecordingError,
    RecordingWriter,
    mesh_file,
    read_about,
    read_bodies,
    read_hands,
)
from manipnet.synthesis.objects.library import LIBRARY_FOLDER, load_library_mesh
from manipnet.wire import HandsMessage
from manipnet_tools import cli
from manipnet_tools.commands.record import record_bodies, record_hands
from manipnet_tools.takes.meshes import recorded_meshes
from manipnet_tools.takes.take import read_take


def address(stage: Stage, what: str) -> str:
    return stage.server.addresses[what].removeprefix("tcp://")


@contextmanager
def moving(stage: Stage) -> Iterator[None]:
    """Hands that move while the block runs."""
    ended = threading.Event()

    def perform() -> None:
        while not ended.is_set():
            stage.perform(0.3, scene)

    thread = threading.Thread(target=perform)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join(PATIENCE_S)


def test_every_hands_message_of_a_server_is_recorded(stage: Stage, tmp_path: Path) -> None:
    path = tmp_path / "take.mcap"
    received: dict[int, HandsMessage] = {}
    with RecordingWriter(path, {}) as writer:
        recorder = threading.Thread(
            target=record_hands,
            args=(parse_endpoint(address(stage, "hands"), 0), None, None, writer, lambda: writer.counts[HANDS] < 40),
        )
        recorder.start()
        while recorder.is_alive():
            received |= {message.seq: message for message in stage.perform(0.5, scene)}
    recorded = list(read_hands(path))
    assert len(recorded) >= 40
    assert [message.seq - recorded[0].seq for message in recorded] == list(range(len(recorded)))
    both = [(message, received[message.seq]) for message in recorded if message.seq in received]
    assert len(both) > 20
    for a, b in both:
        assert np.array_equal(a.hands["left"].joints, b.hands["left"].joints)
    take = read_take(path)
    assert set(take.bodies) == {"left_wrist", "right_wrist", "Box"}
    assert take.rate_hz == pytest.approx(60.0, abs=0.01)


def test_a_recording_names_the_model_and_keeps_the_meshes(
    stage: Stage, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "take.mcap"
    swapped = stage.server.ask({"op": "select_object", "body": "Box", "object": "mug", "scale": 0.8})
    assert swapped.get("object") == "mug"
    with moving(stage):
        server = ["--server", stage.server.addresses["control"]]  # in the form of the ready line
        assert cli.main(["record", "--out", str(path), "--seconds", "1", *server]) == 0
    assert "hands messages" in capsys.readouterr().err
    about = read_about(path)
    hello = stage.server.ask({"op": "hello"})
    assert about.whole
    assert {key: about.metadata[key] for key in ("model", "model_hash", "session")} == {
        key: hello[key] for key in ("model", "model_hash", "session")
    }
    assert list(about.meshes) == ["Box.ply"]
    mug, kept = load_library_mesh("mug", 0.8), recorded_meshes(path)["Box"]
    assert np.allclose(kept.vertices, mug.vertices, atol=1e-6)
    assert np.array_equal(kept.faces, mug.faces)


@pytest.fixture
def nobody() -> str:
    """The address of a control port at which nothing listens."""
    with socket.socket() as tcp:
        tcp.bind(("127.0.0.1", 0))
        return f"127.0.0.1:{tcp.getsockname()[1]}"


@pytest.mark.parametrize("scheme", ["", "tcp://"])
def test_without_a_server_it_says_so_and_leaves_no_file(
    scheme: str, nobody: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "take.mcap"
    assert cli.main(["record", "--out", str(path), "--server", scheme + nobody]) == 1
    errors = capsys.readouterr().err
    assert f"no server answers at tcp://{nobody} yet" in errors
    assert f"no server answers at tcp://{nobody} within 3 s; " in errors
    assert "--server HOST:PORT" in errors  # a server of another test may run here, and then it is named
    assert not list(tmp_path.iterdir())


def test_when_nothing_arrives_it_says_where_it_listens_and_leaves_no_file(
    stage: Stage, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "take.mcap"
    assert cli.main(["record", "--out", str(path), "--bodies-port", "0", "--seconds", "1.3"]) == 1
    errors = capsys.readouterr().err
    assert "nothing arrives at tcp://127.0.0.1:" in errors
    assert f"nothing arrived within 1.3 s, so {path} was not written" in errors
    assert not list(tmp_path.iterdir())


def test_a_recording_is_replaced_only_by_force(
    stage: Stage, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "take.mcap"
    path.write_text("precious")
    command = ["record", "--out", str(path), "--seconds", "1", "--server", stage.server.addresses["control"]]
    assert cli.main(command) == 1
    assert "already exists; give another name, or --force to replace it" in capsys.readouterr().err
    assert path.read_text() == "precious"
    with moving(stage):
        assert cli.main([*command, "--force"]) == 0
    assert read_about(path).whole
    assert cli.main(["record", "--out", str(tmp_path / "take.txt")]) == 1
    assert "must end in .mcap" in capsys.readouterr().err


def test_bodies_are_recorded_without_a_server(tmp_path: Path) -> None:
    def send(where: str) -> None:
        sender = Sender(where)
        for k in range(120):
            sender.send(k / 120, scene(k / 120))
        sender.close()

    path = tmp_path / "take.mcap"
    senders: list[threading.Thread] = []

    def listening(where: str) -> None:
        senders.append(threading.Thread(target=send, args=(where,)))
        senders[0].start()

    with RecordingWriter(path, {}) as writer:
        record_bodies(0, writer, lambda: writer.counts[BODIES] < 120, listening)
    senders[0].join(PATIENCE_S)
    assert [frame.t_s for frame in read_bodies(path)] == [k / 120 for k in range(120)]


def test_a_killed_recorder_leaves_a_file_that_can_be_repaired(tmp_path: Path) -> None:
    path = tmp_path / "take.mcap"
    command = [sys.executable, "-m", "manipnet_tools.cli", "record", "--bodies-port", "0", "--out", str(path)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=os.environ | {"COLUMNS": "200"}) as recorder:
        assert recorder.stderr is not None
        sender = Sender(next(word for line in recorder.stderr for word in line.split() if word.startswith("tcp://")))
        sent, give_up_s = 0, time.monotonic() + PATIENCE_S
        while (on_disk := frames_on_disk(path)) < 200:
            assert time.monotonic() < give_up_s
            for _ in range(20):
                sender.send(sent / 120, scene(sent / 120))
                sent += 1
        recorder.kill()
        recorder.wait(PATIENCE_S)
        sender.close()
    frames = list(read_bodies(path))
    assert len(frames) >= on_disk
    assert [frame.t_s for frame in frames] == [k / 120 for k in range(len(frames))]
    assert cli.main(["recover", str(path), "--out", str(tmp_path / "repaired.mcap")]) == 0
    assert len(read_take(tmp_path / "repaired.mcap").time_s) == len(frames)


def frames_on_disk(path: Path) -> int:
    try:
        return sum(1 for _ in read_bodies(path))
    except RecordingError:
        return 0


def test_a_recording_is_replayed_into_a_server(stage: Stage, tmp_path: Path) -> None:
    """It is played through the real socket, with another object than at the time of the recording."""
    path = record_scene(tmp_path / "take.mcap", 2.5)
    assert stage.server.ask({"op": "select_object", "body": "Box", "object": "sphere"})["object"] == "sphere"
    assert cli.main(["replay", str(path), "--server", stage.server.addresses["control"]]) == 0
    shown = [stage.subscriber.next()]
    while not 2.4 < shown[-1].t_capture < 10.0:
        shown.append(stage.subscriber.next())
        assert len(shown) < 3_000
    late = [m for m in shown if 1.0 < m.t_capture < 2.4 and "left" in m.hands]  # eased there from the run before
    live = [m for m in late if m.hands["left"].state == "live"]
    assert len(live) > 10  # a busy machine may skip ticks
    for message in live:
        assert np.allclose(message.hands["left"].wrist, scene(message.t_capture)["left_wrist"], atol=2e-3)
        assert message.hands["left"].object == "Box"


def test_a_recording_is_synthesised_again_with_another_object(tiny_bundle: Path, tmp_path: Path) -> None:
    cube = load_library_mesh("cube")
    path = record_scene(tmp_path / "take.mcap", 1.5, {"Box.ply": mesh_file(cube.vertices, cube.faces)})

    def fingers(name: str, *mesh: str) -> np.ndarray:
        options = [str(path), *mesh, "--model", str(tiny_bundle), "--out", str(tmp_path / name)]
        assert cli.main(["synthesize", *options]) == 0
        with np.load(tmp_path / name) as file:
            assert file["objects"].tolist() == ["Box"]
            return file["left_positions"]

    kept = fingers("kept.npz")
    assert np.allclose(kept, fingers("cube.npz", "--mesh", f"Box={LIBRARY_FOLDER / 'cube.ply'}"), atol=1e-5)
    assert np.abs(kept - fingers("bottle.npz", "--mesh", f"Box={LIBRARY_FOLDER / 'bottle.ply'}")).max() > 2e-3
