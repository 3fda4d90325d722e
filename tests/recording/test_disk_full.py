"""A disk that is full: why a recording ends is logged and answered, what is there is kept, and no other begins."""

import multiprocessing
import sys
import time
from pathlib import Path

import pytest
from publisher import message

from manipnet.recording import recorder as recording
from manipnet.recording.mcap_file import read_hands
from manipnet.recording.recorder import Recorder
from manipnet.telemetry import Telemetry
from manipnet.wire import encode_msgpack

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit for the size of a file")
LIMIT_BYTES = 400_000


def ask(recorder: Recorder, op: str, **request: str) -> str:
    """The error of a request, or an empty text."""
    try:
        recorder.handlers()[op](request)
    except ValueError as error:
        return str(error)
    return ""


def record_until_the_end(folder: Path, log: Path) -> None:
    """A process whose files cannot grow beyond a limit, which its recorder's process inherits."""
    import logging
    import resource

    logging.basicConfig(filename=log, level=logging.WARNING)
    resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT_BYTES, LIMIT_BYTES))
    recorder = Recorder(folder, lambda: ({"session": "s"}, []), Telemetry())
    assert ask(recorder, "record", name="first") == ""
    seq, give_up_s = 0, time.monotonic() + 120.0
    while recorder.current() is not None:
        recorder.note(encode_msgpack(message(seq, seq / 60, 0.1)))
        seq += 1
        time.sleep(1e-3)
        assert time.monotonic() < give_up_s
    error = ask(recorder, "stop_recording")
    logging.warning("stop_recording: %s", error)
    logging.warning("again: %s", ask(recorder, "stop_recording"))


def test_why_a_recording_ends_is_logged_and_answered_and_what_is_there_is_kept(tmp_path: Path) -> None:
    log = tmp_path / "log.txt"
    process = multiprocessing.get_context("spawn").Process(target=record_until_the_end, args=(tmp_path, log))
    process.start()
    process.join(200.0)
    assert process.exitcode == 0
    lines = log.read_text().splitlines()
    assert any("first.mcap has ended early (File too large)" in line for line in lines if "ERROR" in line)
    assert any("stop_recording: first.mcap has ended early (File too large)" in line for line in lines)
    assert any("again: nothing is being recorded" in line for line in lines)
    assert len(list(read_hands(tmp_path / "first.mcap"))) > 10


def test_no_recording_begins_on_a_full_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recorder = Recorder(tmp_path / "takes", lambda: ({}, []), Telemetry())
    monkeypatch.setattr(recording, "MIN_FREE_BYTES", 1 << 80)
    assert "MB left, and a recording needs" in ask(recorder, "record")
    assert not (tmp_path / "takes").exists()
