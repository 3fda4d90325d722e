"""The lines for the terminal: no text and no closed output ends the thread that writes them."""

import io
import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from screen import Screen

from manipnet.common.text_output import accept_any_text
from manipnet.runtime.console import Console
from manipnet.runtime.log_file import open_log_file
from manipnet.runtime.terminal import Terminal, ready_table


@contextmanager
def outputs(monkeypatch: pytest.MonkeyPatch, folder: Path) -> Iterator[tuple[int, Path]]:
    """Standard output is a pipe, and standard error a file, both in cp1252; the pipe's end to read, and the file.

    A context manager rather than a fixture, since pytest puts its own streams in place before the test itself.
    """
    read, write = os.pipe()
    errors = folder / "errors.txt"
    with (
        monkeypatch.context() as streams,
        io.TextIOWrapper(os.fdopen(write, "wb"), encoding="cp1252") as stdout,
        open(errors, "w", encoding="cp1252") as stderr,
    ):
        streams.setattr(sys, "stdout", stdout)
        streams.setattr(sys, "stderr", stderr)
        yield read, errors
        streams.undo()


def log(console: Console, text: str) -> None:
    console.handle(logging.LogRecord("manipnet", logging.WARNING, "", 0, text, None, None))


def test_what_an_output_cannot_show_is_escaped(monkeypatch, tmp_path):
    with outputs(monkeypatch, tmp_path) as (read, errors):
        console = Console()
        console.say("日本 ä")
        log(console, "→ one")
        console.say("next")
        console.close()
        os.set_blocking(read, False)
        assert os.read(read, 1000) == rb"\u65e5\u672c " + b"\xe4\nnext\n"
        os.close(read)
        assert r"\u2192 one" in errors.read_text(encoding="cp1252")


def test_no_text_controls_the_terminal(monkeypatch, tmp_path):
    with outputs(monkeypatch, tmp_path) as (read, errors):
        console = Console()
        console.say("a\x1b[31m\r\x07b\x9bc\td")
        log(console, "x\x1b]0;title\x07")
        console.close()
        assert os.read(read, 4096) == b"a\\x1b[31m\\x0d\\x07b\\x9bc\td" + os.linesep.encode()
        assert "x\\x1b]0;title\\x07" in errors.read_text()


def test_a_closed_output_leaves_the_log_alive_and_is_reported_once(monkeypatch, tmp_path):
    with outputs(monkeypatch, tmp_path) as (read, errors):
        os.close(read)
        console = Console()
        for i in range(3):
            console.say(f"line {i}")
            log(console, f"record {i}")
        console.close()
        text = errors.read_text(encoding="cp1252")
    assert all(f"record {i}" in text for i in range(3))
    assert text.count("standard output cannot be written any more") == 1


def test_programs_accept_any_text(monkeypatch, tmp_path):
    with outputs(monkeypatch, tmp_path) as (read, _):
        accept_any_text()
        print("→", flush=True)
        os.set_blocking(read, False)
        assert os.read(read, 100) == b"\\u2192\n"
        os.close(read)


OPEN_A_FILE = """
import os
from manipnet.common.text_output import accept_any_text
accept_any_text()
raise SystemExit(os.open("opened", os.O_CREAT | os.O_WRONLY))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="a shell of Unix closes the streams")
@pytest.mark.parametrize("closed", ["", "0", "1", "2", "01", "02", "12", "012"])
def test_nothing_takes_the_place_of_a_closed_standard_stream(closed: str, tmp_path: Path) -> None:
    streams = " ".join(f"{stream}>&-" for stream in closed)
    program = ["sh", "-c", f'exec "$0" "$@" {streams}', sys.executable, "-c", OPEN_A_FILE]
    assert subprocess.run(program, cwd=tmp_path, check=False).returncode > 2


def test_a_terminal_has_one_status_line_below_the_lines():
    screen = Screen()
    terminal = Terminal(screen)  # pyright: ignore[reportArgumentType]
    terminal.status("60 hands/s | left live mug")
    terminal.status("59 hands/s | left rest")
    terminal.line("left rest")
    terminal.status("x" * 200)
    assert [line.rstrip() for line in screen.lines] == ["left rest", "x" * 78 + "…"]
    terminal.status("日本" * 60)
    assert sum(2 if letter in "日本" else 1 for letter in screen.lines[-1].rstrip()) < 80
    terminal.status("")
    terminal.line("stopped")
    assert [line.rstrip() for line in screen.lines] == ["left rest", "stopped", ""]


def test_the_addresses_are_a_table_with_the_page_first():
    lines = ready_table(
        "ready hands tcp://127.0.0.1:5555 bodies tcp://127.0.0.1:5556 page http://127.0.0.1:8080", "a b.log"
    )
    assert [line.split()[:2] for line in lines[1:4]] == [
        ["page", "http://127.0.0.1:8080"],
        ["bodies", "tcp://127.0.0.1:5556"],
        ["hands", "tcp://127.0.0.1:5555"],
    ]
    assert "  log: a b.log" in lines
    assert all(len(line) < 80 for line in lines)


def test_a_pipe_gets_plain_lines_and_the_log_file_everything(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with outputs(monkeypatch, tmp_path) as (read, _):
        file = open_log_file()
        assert file is not None
        console = Console(log_file=file)
        console.say("ready page http://127.0.0.1:8080")
        console.show("60 hands/s")
        log(console, "a warning")
        console.close()
        os.set_blocking(read, False)
        assert os.read(read, 4096) == b"ready page http://127.0.0.1:8080" + os.linesep.encode()
        os.close(read)
    text = Path(file.baseFilename).read_text(encoding="utf-8")
    assert "INFO manipnet: ready page" in text
    assert "WARNING manipnet: a warning" in text


def test_old_log_files_are_deleted(monkeypatch, tmp_path):
    monkeypatch.setattr("manipnet.runtime.log_file.log_folder", lambda: tmp_path)
    for day in range(1, 20):
        (tmp_path / f"server 2026-01-{day:02d} 10.00.00 1.log").touch()
        (tmp_path / f"server 2026-01-{day:02d} 10.00.00 1.log.1").touch()
    file = open_log_file()
    assert file is not None
    file.emit(logging.LogRecord("manipnet", logging.INFO, "", 0, "begun", None, None))
    file.close()
    left = sorted(tmp_path.glob("server *.log"))
    assert len(left) == 10
    assert not (tmp_path / "server 2026-01-01 10.00.00 1.log.1").exists()
