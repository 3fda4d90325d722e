"""Slate, number and note of a take: named by them, kept beside it, changed, and deleted with it."""

from pathlib import Path
from typing import Any

import pytest

from manipnet.control.request import RequestError
from manipnet.recording.recorder import Recorder
from manipnet.recording.take_notes import TakeNotes, read_notes
from manipnet.telemetry import Telemetry


@pytest.fixture
def notes(tmp_path: Path) -> TakeNotes:
    return TakeNotes(tmp_path, Recorder(tmp_path, lambda: ({}, []), Telemetry()))


def ask(about: TakeNotes, op: str, **request: Any) -> dict[str, Any]:
    return about.handlers()[op](request)


def test_a_take_is_named_by_slate_and_number_and_keeps_them(notes: TakeNotes, tmp_path: Path) -> None:
    assert ask(notes, "record", slate="12A", number=3)["name"] == "12A take 3.mcap"
    assert ask(notes, "recordings")["recording"]["name"] == "12A take 3.mcap"
    while not (tmp_path / "12A take 3.mcap").exists():
        pass  # it is created by the thread that writes it
    with pytest.raises(RequestError, match="still being recorded"):
        ask(notes, "delete_recording", recording="12A take 3.mcap")
    notes._recorder["stop_recording"]({})
    (take,) = ask(notes, "recordings", notes=True)["takes"]
    assert (take["name"], take["slate"], take["number"]) == ("12A take 3.mcap", "12A", 3)
    assert "takes" not in ask(notes, "recordings"), "the notes are only read for those who ask for them"


def test_a_take_is_described_renamed_and_deleted(notes: TakeNotes, tmp_path: Path) -> None:
    (tmp_path / "one.mcap").write_bytes(b"")
    (tmp_path / "two.mcap").write_bytes(b"")
    assert ask(notes, "edit_recording", recording="one.mcap", note="good, but dropped")["note"] == "good, but dropped"
    renamed = ask(notes, "edit_recording", recording="one.mcap", name="best", number=2)
    assert renamed == {"name": "best.mcap", "note": "good, but dropped", "number": 2}
    assert not (tmp_path / "one.mcap").exists()
    assert not (tmp_path / "one.json").exists()
    assert read_notes(tmp_path / "best.mcap") == {"note": "good, but dropped", "number": 2}
    with pytest.raises(RequestError, match=r"two\.mcap already exists"):
        ask(notes, "edit_recording", recording="best.mcap", name="two")
    ask(notes, "edit_recording", recording="best.mcap", note="")
    ask(notes, "delete_recording", recording="best.mcap")
    assert [path.name for path in tmp_path.iterdir()] == ["two.mcap"]


@pytest.mark.parametrize("name", ["../two.mcap", "none.mcap", "", None, 7, "/etc/passwd"])
@pytest.mark.parametrize("op", ["edit_recording", "delete_recording"])
def test_only_takes_of_the_folder_are_touched(notes: TakeNotes, tmp_path: Path, op: str, name: Any) -> None:
    outside = tmp_path.parent / "two.mcap"
    outside.write_bytes(b"")
    with pytest.raises(RequestError, match="`recordings` lists"):
        ask(notes, op, recording=name)
    assert outside.exists()


@pytest.mark.parametrize(
    "about", [{"number": -1}, {"number": True}, {"number": "1"}, {"slate": 7}, {"note": "x" * 3000}]
)
def test_what_is_not_a_note_is_refused(notes: TakeNotes, tmp_path: Path, about: dict[str, Any]) -> None:
    (tmp_path / "one.mcap").write_bytes(b"")
    with pytest.raises(RequestError, match=r"allowed are|must be a text"):
        ask(notes, "edit_recording", recording="one.mcap", **about)


def test_a_damaged_file_of_notes_holds_nothing(notes: TakeNotes, tmp_path: Path) -> None:
    (tmp_path / "one.mcap").write_bytes(b"")
    for content in (b"{", b"[1]", b"\xff", b'{"number": "many"}'):
        (tmp_path / "one.json").write_bytes(content)
        (take,) = ask(notes, "recordings", notes=True)["takes"]
        assert set(take) == {"name", "bytes", "changed_s"}
