"""The folders of the checkout and of a test run, programs that tests need, and a publisher to read from."""

import os
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


def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A temporary folder of this test run, which all workers of pytest-xdist share."""
    base = tmp_path_factory.getbasetemp()
    return base.parent if "PYTEST_XDIST_WORKER" in os.environ else base


def need(*tools: str) -> list[str]:
    """Paths of command line tools. Skips the test if one of them is missing."""
    missing = [tool for tool in tools if shutil.which(tool) is None]
    if missing:
        pytest.skip(f"needs {', '.join(missing)} (see clients/README.md for the Debian packages)")
    return [str(shutil.which(tool)) for tool in tools]


@contextmanager
def publishing(*options: str) -> Iterator[tuple[subprocess.Popen, str, str]]:
    """Start a process that publishes hands; yields it with its tcp:// and ws:// addresses once it listens."""
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
        if process.stdout is not None:
            process.stdout.close()
