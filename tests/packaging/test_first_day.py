"""The walk of docs/first-day.md, followed to the letter: every command of it runs, in order, in an empty folder.

Only the installation is left out, because the tests run on what is installed. So that the walk meets no other server,
the server takes free ports, and the commands that talk to it name it.
"""

import csv
import os
import queue
import re
import shlex
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import IO

import pytest
from live_server import free_ports

from manipnet.recording.mcap_file import read_about

PAGE = Path(__file__).parents[2] / "docs" / "first-day.md"
ASKS_THE_SERVER = ("doctor", "record")
PATIENCE_S = 300.0


def commands() -> list[list[str]]:
    blocks = re.findall(r"^```sh\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.M | re.S)
    return [shlex.split(line) for block in blocks for line in block.splitlines()]


def program(word: str) -> list[str]:
    return [sys.executable, "-m", {"manipnet": "manipnet_tools.cli", "manipnet-serve": "manipnet.cli"}[word]]


def forward(stream: IO[str], lines: "queue.Queue[str]") -> None:
    with stream:
        for line in stream:
            lines.put(line)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGINT for another process")
def test_the_walk_can_be_followed(tmp_path: Path) -> None:
    environment = {**os.environ, "BROWSER": "true"}
    server: subprocess.Popen[str] | None = None
    reader: threading.Thread | None = None
    lines: queue.Queue[str] = queue.Queue()
    control = ""
    done: list[str] = []
    try:
        for word, *arguments in commands():
            if word == "manipnet-serve":
                command = [*program(word), *arguments, *free_ports()]
                server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=tmp_path, env=environment)
                stdout = server.stdout
                assert stdout is not None
                reader = threading.Thread(target=forward, args=(stdout, lines), daemon=True)
                reader.start()
                words = lines.get(timeout=PATIENCE_S).split()
                control = words[words.index("control") + 1]
                while "bodies arrive" not in lines.get(timeout=PATIENCE_S):
                    pass
                continue
            more = ["--server", control] if arguments[0] in ASKS_THE_SERVER else []
            ran = subprocess.run(
                [*program(word), *arguments, *more],
                capture_output=True,
                text=True,
                cwd=tmp_path,
                env=environment,
                timeout=PATIENCE_S,
                check=False,
            )
            assert ran.returncode == 0, (arguments, ran.stdout, ran.stderr)
            done.append(arguments[0])
        assert server is not None
        server.send_signal(signal.SIGINT)
        assert server.wait(PATIENCE_S) == 0
    finally:
        if server is not None:
            server.kill()
            server.wait()
        if reader is not None:
            reader.join(PATIENCE_S)
    assert done == ["--version", "bench", "doctor", "record", "synthesize", "export", "export"]
    about = read_about(tmp_path / "mug 1.mcap")
    assert about.whole
    assert about.counts["/hands"] > 100
    assert (tmp_path / "mug 1.glb").read_bytes()[:4] == b"glTF"
    with (tmp_path / "hammer 1.csv").open(encoding="utf-8") as file:
        assert len(list(csv.reader(file))) > 100
