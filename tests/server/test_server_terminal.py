"""What a person sees of a server in a terminal of 80 columns, and what a pipe gets."""

import os
import select
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import msgpack
import pytest
import zmq
from live_server import START_S, free_ports, serving
from screen import Screen

import manipnet
from manipnet.common.shipped_folder import FOLDER

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo terminals of this kind")
PATIENCE_S = 60.0


class Watched:
    """A server in a pseudo terminal."""

    def __init__(self, *options: str, **environment: str) -> None:
        self.screen = Screen()
        self.raw = ""
        self._end, child = os.openpty()
        self.process = subprocess.Popen(
            [sys.executable, "-m", "manipnet.cli", *free_ports(), *options],
            stdin=child,
            stdout=child,
            stderr=child,
            env={**os.environ, "COLUMNS": "80", **environment},
        )
        os.close(child)

    def until(self, seen: Callable[[], bool], seconds: float = PATIENCE_S) -> None:
        """Read until something is seen."""
        end_s = time.monotonic() + seconds
        while not seen():
            assert time.monotonic() < end_s, self.screen.lines
            if not self._read():
                assert seen(), self.screen.lines

    def address(self, what: str) -> str:
        return next(line.split()[1] for line in self.screen.lines if line.split()[:1] == [what])

    def has(self, text: str) -> bool:
        return any(text in line for line in self.screen.lines)

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        os.close(self._end)

    def _read(self) -> bool:
        if not select.select([self._end], [], [], 0.2)[0]:
            return self.process.poll() is None
        try:
            text = os.read(self._end, 65_536).decode("utf-8", "replace")
        except OSError:  # the server has ended
            return False
        self.raw += text
        self.screen.write(text)
        return True


@pytest.fixture
def watched(tiny_bundle: Path, tmp_path: Path) -> Iterator[Watched]:
    server = Watched("--demo", "--model", str(tiny_bundle), "--takes", str(tmp_path / "takes"))
    yield server
    server.close()


def ask(address: str, **request: str) -> dict:
    with zmq.Context() as context, context.socket(zmq.REQ) as socket:
        socket.setsockopt(zmq.LINGER, 0)
        socket.connect(address)
        socket.send(msgpack.packb(request) or b"")
        assert socket.poll(int(1e3 * PATIENCE_S))
        return msgpack.unpackb(socket.recv())


def test_a_person_sees_a_table_and_one_status_line(watched: Watched, tmp_path: Path) -> None:
    watched.until(lambda: watched.has("hands/s"), START_S)
    lines = [line.rstrip() for line in watched.screen.lines]
    begin = lines.index("ready")
    assert lines[begin + 1].split()[0] == "page"
    assert any(line.startswith("  log: ") and line.endswith(".log") for line in lines)
    table = lines[begin : lines.index("Ctrl-C stops the server") + 1]
    assert all(len(line) < 80 for line in table if not line.startswith("  log: "))
    count = len(watched.screen.lines)
    rewritten = watched.raw.count("hands/s")
    watched.until(lambda: watched.raw.count("hands/s") >= rewritten + 4)
    assert len(watched.screen.lines) - count <= 6  # changes of hands, but not a line for each second
    assert all(len(line.rstrip()) < 80 for line in watched.screen.lines if "hands/s" in line)

    assert ask(watched.address("control"), op="record", name="walk 1")["name"] == "walk 1.mcap"
    watched.until(lambda: watched.has("REC walk 1 0:0"))
    watched.process.send_signal(signal.SIGINT)
    watched.until(lambda: watched.has("stopped; "))
    folder = (tmp_path / "takes").resolve()
    text = "".join(line.rstrip() for line in watched.screen.lines)
    assert f"stopped; 1 recording is kept in {folder}: walk 1.mcap" in text
    assert watched.process.wait(PATIENCE_S) == 0


def test_a_pipe_gets_the_ready_line_and_lines_only_for_changes(tiny_bundle: Path) -> None:
    with serving("--demo", "--model", str(tiny_bundle)) as server:
        received = [server.line() for _ in range(3)]  # the bodies, and both hands
        begin_s = time.monotonic()
        status = server.ask({"op": "status"})
        while server.ask({"op": "status"})["uptime_s"] < status["uptime_s"] + 4.0:
            pass
        changes = server.lines.qsize()
        seconds = time.monotonic() - begin_s
        assert "bodies" in received[0]
        assert changes < seconds + 3
        assert server.stop() == 0
        left = [server.lines.get_nowait() for _ in range(server.lines.qsize())]
    assert any(line.startswith("stopped; nothing was recorded") for line in left)
    assert not any("hands/s" in line for line in [*received, *left])


def test_a_first_start_says_at_once_that_it_compiles(tiny_bundle: Path, tmp_path: Path) -> None:
    """An installation without kernels says so before the compiler is loaded, in one place, and is stopped then."""
    shutil.copytree(
        Path(manipnet.__file__).parent, tmp_path / "manipnet", ignore=shutil.ignore_patterns("__pycache__", FOLDER)
    )
    places = {"PYTHONPATH": str(tmp_path), "MANIPNET_CACHE": str(tmp_path / "empty")}
    server = Watched("--model", str(tiny_bundle), **places)
    try:
        watched_for = "first start: code is compiled once"
        server.until(lambda: f"{watched_for}, which takes 10 to 30 seconds: 1 s so far" in server.raw)
        assert not server.has("ready")
        assert sum(watched_for in line for line in server.screen.lines) == 1
        assert "WARNING" not in server.raw
    finally:
        server.close()
