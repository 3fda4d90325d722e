"""Where things are, which tools there are, and a publisher to read from."""

import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CLIENTS = ROOT / "clients"
VECTORS = ROOT / "tests" / "vectors"


def need(*tools: str) -> list[str]:
    """Paths of command line tools; skips the test where one is missing."""
    missing = [tool for tool in tools if shutil.which(tool) is None]
    if missing:
        pytest.skip(f"needs {', '.join(missing)} (see clients/README.md for the Debian packages)")
    return [str(shutil.which(tool)) for tool in tools]


@contextmanager
def publishing(*options: str) -> Iterator[tuple[subprocess.Popen, str, str]]:
    """A process that publishes hands; yields it, its tcp:// and its ws:// address once it listens."""
    command = [sys.executable, str(Path(__file__).parent / "publisher.py"), *options]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        word, tcp, websocket = process.stdout.readline().split()
        assert word == "ready"
        yield process, tcp, websocket
    finally:
        process.kill()
        process.wait()
        process.stdout and process.stdout.close()
