"""The wheel of the Python client: installed into an empty environment, typed, and as a user reads from it."""

import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest
from checkout import CLIENTS, publishing

from manipnet import __version__

PROGRAM = """
import sys
import manipnet_client
hands = next(manipnet_client.subscribe(sys.argv[1]))
print(manipnet_client.__version__, hands.actor, hands.left.joints.shape, hands.timecode)
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built wheel; skips where pip cannot fetch the build backend."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(folder), str(CLIENTS / "python")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=180)
    if done.returncode:
        pytest.skip(f"pip cannot build the wheel here: {done.stderr.strip()[-200:]}")
    return next(folder.glob("*.whl"))


def test_the_wheel_is_typed_and_described(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        metadata = archive.read(next(name for name in names if name.endswith("METADATA"))).decode()
    assert "manipnet_client/py.typed" in names
    assert f"Version: {__version__}" in metadata
    assert "Project-URL: Paper" in metadata
    assert "Classifier: Typing :: Typed" in metadata


def test_a_program_reads_hands_with_the_installed_wheel(wheel: Path, tmp_path: Path) -> None:
    environment = tmp_path / "environment"
    venv.create(environment, with_pip=True)
    python = next(environment.glob("*/python.exe"), environment / "bin" / "python")
    done = subprocess.run(
        [python, "-m", "pip", "install", "-q", str(wheel)], capture_output=True, text=True, timeout=180
    )
    if done.returncode:
        pytest.skip(f"pip cannot install numpy here: {done.stderr.strip()[-200:]}")
    with publishing() as (_, tcp, _):
        command = [python, "-I", "-c", PROGRAM, tcp]
        out = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout
    assert out.split(maxsplit=2) == [__version__, "actor", "(26, 7) None\n"]
