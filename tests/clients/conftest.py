"""Builds the harnesses of the clients in other languages."""

import functools
import json

import pytest
from checkout import run_folder
from filelock import FileLock
from languages import build


@pytest.fixture(scope="session")
def harness(tmp_path_factory):
    """Returns the command of a client's harness by name. One worker builds each harness, once in a test run."""

    def built(name: str) -> list[str]:
        folder = run_folder(tmp_path_factory) / f"harness-{name}"
        command = folder / "command.json"
        with FileLock(f"{folder}.lock"):
            if not command.exists():
                folder.mkdir(exist_ok=True)
                command.write_text(json.dumps(build(name, folder)))
        return json.loads(command.read_text())

    return functools.cache(built)
