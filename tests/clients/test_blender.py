"""The packaged extension in a real Blender: poses, takes, undo, files, rigs, props. Each scenario is a process."""

import json
import re
import subprocess
import sys
import threading
import time
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from blender import package
from checkout import ROOT
from live_server import Stage, scene
from real_blender import blender_command, run_in_blender

from manipnet import __version__
from manipnet.geometry import SIDES
from manipnet.synthesis.hand.profile import parse_profile
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet_tools.hands.importing import import_profile

FOLDER = ROOT / "tests" / "clients" / "in_blender"
NEEDS_SERVER = "props_come_with_their_meshes_and_are_recorded"


def scenarios_of(file: str) -> list[str]:
    """The names of the scenarios in a file, which follow its first headline."""
    text = (FOLDER / file).read_text(encoding="utf-8").partition("\n# -- ")[2]
    return [name for name in re.findall(r"^def (\w+)\(\):$", text, re.M) if name != NEEDS_SERVER]


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


@pytest.mark.parametrize("scenario", scenarios_of("scenarios.py"))
def test_in_blender(scenario: str, extensions: Path, actors: str, tmp_path: Path) -> None:
    run_in_blender(str(FOLDER / "scenarios.py"), scenario, str(extensions), actors, str(tmp_path))


@pytest.fixture(scope="module")
def performing(stage: Stage) -> Iterator[dict[str, str]]:
    """The addresses of a real server that carries a box between two hands all the time."""
    stop = threading.Event()

    def send() -> None:
        begin_s = time.monotonic()
        while not stop.wait(1.0 / 120.0):
            t_s = time.monotonic() - begin_s
            stage.sender.send(t_s, scene(t_s))

    sending = threading.Thread(target=send)
    sending.start()
    yield stage.server.addresses
    stop.set()
    sending.join()


@pytest.mark.parametrize("scenario", [NEEDS_SERVER, *scenarios_of("server_scenarios.py")])
def test_with_a_server(scenario: str, extensions: Path, performing: dict[str, str], tmp_path: Path) -> None:
    file = "scenarios.py" if scenario == NEEDS_SERVER else "server_scenarios.py"
    control = {"MANIPNET_CONTROL": performing["control"]}
    arguments = (str(extensions), performing["hands"], str(tmp_path))
    run_in_blender(str(FOLDER / file), scenario, *arguments, environment=control)


@pytest.mark.parametrize("rig", ["mixamo", "metarig"])
def test_a_profile_is_that_of_the_exported_file(rig: str, extensions: Path, tmp_path: Path) -> None:
    run_in_blender(str(FOLDER / "export_avatar.py"), rig, str(extensions), "-", str(tmp_path))
    ours = parse_profile(json.loads((tmp_path / "profile.json").read_text()))
    told: list[str] = []
    theirs = import_profile(tmp_path / "avatar.glb", "avatar", shipped_hand(), told.append)
    for side in SIDES:
        np.testing.assert_allclose(ours.hands[side].joints[:, :3], theirs.hands[side].joints[:, :3], atol=5e-4)
        same = np.abs(np.sum(ours.hands[side].joints[:, 3:] * theirs.hands[side].joints[:, 3:], axis=1))
        assert np.nanmin(same) > 0.9999, told
        np.testing.assert_allclose(ours.hands[side].radii, theirs.hands[side].radii, atol=5e-5)
        assert not np.isnan(ours.hands[side].radii[[7, 12, 17, 22]]).any()


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
