"""The packaged extension in a real Blender: poses, takes, undo, files, rigs, props. Each scenario is a process."""

import re
import subprocess
import sys
import threading
import time
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from blender import package
from checkout import ROOT
from live_server import Stage, scene
from real_blender import blender_command, run_in_blender

from manipnet import __version__

FOLDER = ROOT / "tests" / "clients" / "in_blender"
NEEDS_SERVER = "props_come_with_their_meshes_and_are_recorded"
_TEXT = (FOLDER / "scenarios.py").read_text(encoding="utf-8")
SCENARIOS = [
    name
    for name in re.findall(r"^def (\w+)\(\):$", _TEXT.partition("# -- poses")[2], re.M)
    if name not in (NEEDS_SERVER, "main")
]


@pytest.fixture(scope="module")
def extensions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that holds the extension as packaging writes it."""
    return package.write_unpacked(tmp_path_factory.mktemp("extensions")).parent


@pytest.fixture(scope="module")
def actors() -> Iterator[str]:
    """The address of two actors' hands."""
    blender_command()
    command = [sys.executable, str(ROOT / "tests" / "support" / "actors_publisher.py")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        yield process.stdout.readline().split()[1]
        process.kill()


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_in_blender(scenario: str, extensions: Path, actors: str, tmp_path: Path) -> None:
    run_in_blender(str(FOLDER / "scenarios.py"), scenario, str(extensions), actors, str(tmp_path))


def test_props_in_blender(extensions: Path, stage: Stage, tmp_path: Path) -> None:
    """A real server carries a box, and answers Blender's questions for its mesh."""
    addresses = stage.server.addresses
    stop = threading.Event()

    def send() -> None:
        begin_s = time.monotonic()
        while not stop.wait(1.0 / 120.0):
            t_s = time.monotonic() - begin_s
            stage.sender.send(t_s, scene(t_s))

    sending = threading.Thread(target=send)
    sending.start()
    try:
        control = {"MANIPNET_CONTROL": addresses["control"]}
        arguments = (str(extensions), addresses["hands"], str(tmp_path))
        run_in_blender(str(FOLDER / "scenarios.py"), NEEDS_SERVER, *arguments, environment=control)
    finally:
        stop.set()
        sending.join()


def test_the_zip_holds_the_manifest_and_the_client(tmp_path: Path) -> None:
    path = package.write_zip(tmp_path / "dist")
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
    assert path.name == f"manipnet_live-{__version__}.zip"
    assert {"__init__.py", "manipnet_client/__init__.py", "manipnet_client/layout.py"} <= set(names)
    assert not [name for name in names if "__pycache__" in name or name.endswith(".md")]
    assert manifest["version"] == __version__
    assert manifest["blender_version_min"] == "4.2.0"
    assert manifest["id"] == package.EXTENSION.name
    assert set(manifest["permissions"]) == {"network"}
