"""Takes that are recorded on request while the session goes on."""

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from live_server import Stage, scene, serving

from manipnet.recording.mcap_file import read_about, read_bodies, read_hands
from manipnet.synthesis.objects.library import LIBRARY_FOLDER


@pytest.fixture(scope="module")
def takes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("takes") / "of the day"


@pytest.fixture(scope="module")
def stage(tiny_bundle: Path, takes: Path) -> Iterator[Stage]:
    mesh = f"Box={LIBRARY_FOLDER / 'cube.ply'}"
    with serving("--mesh", mesh, "--model", str(tiny_bundle), "--takes", str(takes)) as server:
        stage = Stage(server)
        yield stage
        stage.close()


def test_a_take_holds_what_was_published_from_record_to_stop(stage: Stage, takes: Path) -> None:
    assert stage.server.ask({"op": "recordings"})["recording"] is None
    begun = stage.server.ask({"op": "record", "name": "first"})
    assert begun == {"name": "first.mcap", "folder": str(takes.resolve())}
    published = stage.perform(1.0, scene)[:-1]  # the last may still be on its way to the recorder
    assert stage.server.ask({"op": "recordings"})["recording"]["name"] == "first.mcap"
    ended = stage.server.ask({"op": "stop_recording"})
    recorded = list(read_hands(takes / "first.mcap"))
    assert (ended["name"], ended["hands"]) == ("first.mcap", len(recorded))
    assert [message.seq for message in recorded if message.seq in {m.seq for m in published}] == [
        message.seq for message in published
    ]
    bodies = list(read_bodies(takes / "first.mcap"))
    assert {body.name for body in bodies[-1].bodies} == {"left_wrist", "right_wrist", "Box"}
    about = read_about(takes / "first.mcap")
    assert about.whole
    assert list(about.meshes) == ["Box.ply"]
    assert about.metadata["model_hash"] == stage.server.ask({"op": "hello"})["model_hash"]
    assert stage.server.ask({"op": "recordings"})["recordings"] == ["first.mcap"]
    assert stage.counted("recorded", "lost") == 0


def test_a_recording_that_cannot_begin_is_refused_with_the_reason(stage: Stage, takes: Path) -> None:
    assert "nothing is being recorded" in stage.server.ask({"op": "stop_recording"})["error"]
    for name in ("../elsewhere", "", "a/b", 7, "x" * 65):
        assert "letters, digits" in stage.server.ask({"op": "record", "name": name})["error"]
    (takes / "there.mcap").write_bytes(b"")
    assert "already exists" in stage.server.ask({"op": "record", "name": "there"})["error"]
    stage.server.ask({"op": "record", "name": "one"})
    assert "one.mcap is being recorded" in stage.server.ask({"op": "record", "name": "two"})["error"]
    assert stage.server.ask({"op": "stop_recording"})["name"] == "one.mcap"


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_however_the_server_ends_the_take_is_whole(tiny_bundle: Path, tmp_path: Path, how: int) -> None:
    with serving("--model", str(tiny_bundle), "--takes", str(tmp_path)) as server:
        stage = Stage(server)
        server.ask({"op": "record", "name": "cut"})
        stage.perform(0.5, lambda t: scene(t))
        while not (tmp_path / "cut.mcap").exists():
            stage.perform(0.1, lambda t: scene(t))
        stage.close()
        server.stop(how)  # standard error stays open until the last process has ended
    assert read_about(tmp_path / "cut.mcap").whole
