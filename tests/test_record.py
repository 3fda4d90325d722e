"""`manipnet record` beside a real server, and in the place of one."""

import threading
from pathlib import Path

import numpy as np
import pytest

from live_server import PATIENCE_S, Sender, Stage, scene
from manipnet.recording import BODIES, HANDS, RecordingWriter, read_about, read_bodies, read_hands
from manipnet.streams.wire import HandsMessage
from manipnet_tools import cli
from manipnet_tools.record import record_bodies, record_hands
from manipnet_tools.takes import read_take


def address(stage: Stage, what: str) -> str:
    return stage.server.addresses[what].removeprefix("tcp://")


def test_what_a_server_says_is_recorded(stage: Stage, tmp_path: Path) -> None:
    path = tmp_path / "take.mcap"
    heard: dict[int, HandsMessage] = {}
    with RecordingWriter(path, {}) as writer:
        recorder = threading.Thread(
            target=record_hands,
            args=(address(stage, "hands"), None, None, writer, lambda: writer.counts[HANDS] < 40),
        )
        recorder.start()
        while recorder.is_alive():
            heard |= {message.seq: message for message in stage.perform(0.5, scene)}
    recorded = list(read_hands(path))
    assert len(recorded) >= 40
    assert [message.seq - recorded[0].seq for message in recorded] == list(range(len(recorded)))
    both = [(message, heard[message.seq]) for message in recorded if message.seq in heard]
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
    server = ["--server", address(stage, "hands"), "--control", address(stage, "control")]
    assert stage.server.ask({"op": "select_object", "body": "Box", "object": "mug"}).get("object") == "mug"
    assert cli.main(["record", "--out", str(path), "--seconds", "0.1", *server]) == 0
    assert "hands messages" in capsys.readouterr().err
    about = read_about(path)
    hello = stage.server.ask({"op": "hello"})
    assert about.whole
    assert {key: about.metadata[key] for key in ("model", "model_hash", "session")} == {
        key: hello[key] for key in ("model", "model_hash", "session")
    }
    assert list(about.meshes) == ["Box.ply"]


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
