"""`manipnet rig` finds the wrists by their names or motion, writes a file, and refuses what it cannot do."""

import threading
from pathlib import Path

import msgpack
import numpy as np
import pytest
import zmq
from live_server import Stage, scene

from manipnet import cli as server_cli
from manipnet.common.options import ConfigError
from manipnet.config.rig_reader import load_rig
from manipnet.wire.bodies import BodyFrame, BodySample
from manipnet_tools import cli
from manipnet_tools.commands.rig import report
from manipnet_tools.commands.rig_guess import BodyCollector, guess, rig_of


def streamed(*bodies: tuple[int | None, str | None, float]):
    """Bodies by id, name, and the speed at which they move back and forth for three seconds, with a tracker's noise."""
    collector, rng = BodyCollector(), np.random.default_rng(3)
    for i in range(360):
        samples = tuple(
            BodySample(id, name, (speed * abs((i / 120) % 1.0 - 0.5), *rng.normal(0.0, 5e-4, 2)), (0, 0, 0, 1), True)
            for id, name, speed in bodies
        )
        collector(BodyFrame(i / 120, i, samples, i / 120, "zmq:test"))
    return list(collector.bodies.values())


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("left_wrist", "right_wrist"),
        ("LeftHand", "RightHand"),
        ("LHand", "RHand"),
        ("wrist.L", "wrist.R"),
        ("Left", "Right"),
        ("Ann_glove_left", "Ann_glove_right"),
    ],
)
def test_wrists_are_found_by_their_names(left: str, right: str) -> None:
    found = guess(streamed((3, right, 0.0), (None, "Leftover Box", 2.0), (1, left, 0.0)), {})
    assert {part: key for part, (key, _) in found.wrists.items()} == {"left_wrist": left, "right_wrist": right}
    assert [body.key for body in found.others] == ["Leftover Box"]


def test_wrists_without_names_are_the_bodies_that_moved_most() -> None:
    found = guess(streamed((1, None, 0.0), (2, None, 0.3), (7, None, 0.9), (8, None, 0.02)), {})
    assert {part: key for part, (key, _) in found.wrists.items()} == {"left_wrist": 2, "right_wrist": 7}
    assert "swapped" in found.wrists["left_wrist"][1]


def test_wrists_that_are_given_are_not_guessed() -> None:
    found = guess(streamed((1, None, 0.9), (2, None, 0.6)), {"left_wrist": 1})
    assert {part: key for part, (key, _) in found.wrists.items()} == {"left_wrist": 1, "right_wrist": 2}


def test_without_a_wrist_the_error_names_the_remedy() -> None:
    with pytest.raises(
        ConfigError,
        match=r"arrived: Box, 2\); wave both hands while this command listens, the right hand more",
    ):
        guess(streamed((None, "Box", 0.0), (2, None, 0.0)), {})


def test_the_rig_can_be_read_and_unknown_bodies_stay_as_comments(tmp_path: Path) -> None:
    found = guess(
        streamed(
            (1, "LeftHand", 0.0), (2, "RightHand", 0.0), (3, "Mug 2", 0.0), (4, 'My "Head"', 0.0), (5, "Box", 0.0)
        ),
        {},
    )
    (tmp_path / "rig.toml").write_text(rig_of(found, {"natnet": "10.0.0.2"}), encoding="utf-8")
    rig = load_rig(tmp_path / "rig.toml")
    assert [(thing.body.key, thing.mesh.stem) for thing in rig.actors[0].objects] == [("Mug 2", "mug"), ("Box", "cube")]
    assert rig.server == {"natnet": ("10.0.0.2", 1510)}
    assert '# body = "My \\"Head\\""' in (tmp_path / "rig.toml").read_text(encoding="utf-8")


def test_guesses_are_said_with_their_doubt() -> None:
    found = guess(
        streamed((1, "LeftHand", 0.0), (2, "RightHand", 0.0), (3, "mug1", 0.0), (4, "Head", 0.0), (9, None, 0.0)), {}
    )
    lines = report(found)
    assert "left_wrist: LeftHand (by its name)" in lines
    assert any(
        "prop mug1: the mesh mug of the library, guessed from its name; check its shape" in line for line in lines
    )
    assert any("prop Head: no mesh is known" in line for line in lines)


def test_init_asks_a_running_server(tmp_path: Path, stage: Stage, capsys) -> None:
    stage.perform(0.3, scene)
    path = tmp_path / "rig.toml"
    assert cli.main(["rig", "init", str(path), "--server", stage.server.addresses["control"]]) == 0
    assert {part: body.key for part, body in load_rig(path).actors[0].wrists.items()} == {
        "left_wrist": "left_wrist",
        "right_wrist": "right_wrist",
    }
    assert "prop Box: the mesh cube of the library" in capsys.readouterr().out


class Waving:
    """A sender that waves two bodies while the command listens."""

    def __init__(self) -> None:
        self._context = zmq.Context()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self, address: str) -> None:
        self._socket = self._context.socket(zmq.PUB)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.connect(address)
        self._thread.start()

    def stop(self) -> None:
        self._stopping.set()
        self._thread.join()
        self._socket.close()
        self._context.term()

    def _run(self) -> None:
        i = 0
        while not self._stopping.wait(1 / 240):
            i += 1
            bodies = [{"id": k, "p": [0.1 * k * (i % 2), 0, 0], "q": [0, 0, 0, 1]} for k in (1, 2)]
            self._socket.send(msgpack.packb({"t": i / 240, "bodies": bodies}))


@pytest.mark.slow
def test_init_listens_and_writes_and_replaces_a_file_only_with_force(tmp_path: Path, capsys, monkeypatch) -> None:
    waving, path = Waving(), tmp_path / "rig.toml"
    waited = threading.Event.wait

    def wait(event: threading.Event, timeout: float | None = None) -> bool:
        if timeout == 3.0:  # the command listens: begin to wave where it says it does
            lines = capsys.readouterr().out.split()
            waving.start(next(word for word in lines if word.startswith("tcp://")))
        return waited(event, timeout)

    monkeypatch.setattr(threading.Event, "wait", wait)
    command = ["rig", "init", str(path), "--input-port", "0", "--osc-port", "0"]
    try:
        assert cli.main(command) == 0
    finally:
        waving.stop()
    output = capsys.readouterr().out
    assert "right_wrist: 2 (it moved" in output
    assert {part: body.key for part, body in load_rig(path).actors[0].wrists.items()} == {
        "left_wrist": 1,
        "right_wrist": 2,
    }
    before = path.read_text(encoding="utf-8")
    assert cli.main(command) == 1
    assert "already exists; give another name, or --force to replace it" in capsys.readouterr().err
    assert path.read_text(encoding="utf-8") == before
    wrists = ["--left-wrist", "Anna", "--right-wrist", "4", "--seconds", "0.01", "--force"]
    assert cli.main([*command, *wrists]) == 0
    assert "the file it replaces is now" in capsys.readouterr().out
    assert (tmp_path / "rig.toml.bak").read_text(encoding="utf-8") == before
    assert load_rig(path).actors[0].wrists["left_wrist"].key == "Anna"


def test_init_writes_nothing_if_nothing_arrives(tmp_path: Path, capsys) -> None:
    command = ["rig", "init", str(tmp_path / "rig.toml"), "--input-port", "0", "--osc-port", "0", "--seconds", "0.01"]
    assert cli.main(command) == 1
    assert "nothing arrived within 0.01 s; `manipnet doctor` says why" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_show_prints_the_same_as_the_server(capsys) -> None:
    options = ["--set", "bodies.left_wrist=3", "--mesh", "7=mug"]
    assert cli.main(["rig", "show", *options]) == 0
    shown = capsys.readouterr().out
    assert server_cli.main([*options, "--print-config"]) == 0
    assert capsys.readouterr().out == shown
    assert "left_wrist = 3" in shown
