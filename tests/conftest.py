"""What every test may ask for."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

sys.path.insert(0, str(Path(__file__).parent))

from live_server import Stage, serving
from manipnet.objects.library import LIBRARY_FOLDER
from tiny_bundle import write_tiny_bundle

# the first example pays for compiling; the same examples every run
settings.register_profile("manipnet", deadline=None, derandomize=True)
settings.load_profile("manipnet")


@pytest.fixture(scope="session")
def manipnet_data() -> Path:
    """The ManipNet dataset, which is not part of the project."""
    folder = os.environ.get("MANIPNET_DATA")
    if not folder:
        pytest.skip("MANIPNET_DATA is not set: it names the dataset folder (BVH/ and meshes/)")
    return Path(folder)


@pytest.fixture(scope="session")
def tiny_bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model without training that runs in no time."""
    return write_tiny_bundle(tmp_path_factory.mktemp("models") / "tiny")


@pytest.fixture(scope="module")
def stage(tiny_bundle: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    """A real server that knows left_wrist, right_wrist and a cube named Box, with a sender and a subscriber.

    One per module: starting it takes seconds. `stage.perform` plays each performance at a later time.
    """
    dumps = tmp_path_factory.mktemp("dumps")
    with serving(
        "--mesh", f"Box={LIBRARY_FOLDER / 'cube.ply'}", "--model", str(tiny_bundle), "--dump-dir", str(dumps)
    ) as server:
        stage = Stage(server)
        yield stage
        stage.close()
