"""Fixtures that every test may use, and the markers that say what a test needs."""

import os
import queue
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from live_server import Stage, serving
from tiny_bundle import write_tiny_bundle

from manipnet.synthesis.objects.library import LIBRARY_FOLDER
from manipnet.telemetry import Telemetry
from manipnet.wire.bodies import BodyFrame

# the first example pays for compiling; the same examples every run
settings.register_profile("manipnet", deadline=None, derandomize=True)
settings.load_profile("manipnet")

PATIENCE_S = 20.0
STARTS_PROCESSES = {"subprocess", "multiprocessing", "serving", "publishing", "browsing", "run_node"}
"""A module that imports one of these has tests that start programs."""
TESTS = Path(__file__).parent
CLIENTS = TESTS / "clients"
SLOW = tuple(
    TESTS / place
    for place in (
        "fuzz",
        "net/test_supervised.py",
        "packaging/test_dependencies.py",
        "runtime/test_bad_network.py",
        "runtime/test_object_catalog.py",
        "synthesis/ik",  # compiles the solvers anew
        "tools/bench",
        "tools/doctor",
        "tools/importing/test_import.py",
        "tools/training",
    )
)
"""Folders and files whose tests take a second each."""


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Do not even import what `-m quick` leaves out: that takes seconds too."""
    return True if config.option.markexpr == "quick" and collection_path in (CLIENTS, *SLOW) else None


def pytest_configure() -> None:
    """Let servers announce themselves where no doctor outside of the tests looks."""
    os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp(prefix="manipnet-tests-")


def pytest_unconfigure() -> None:
    """Leave nothing behind."""
    shutil.rmtree(os.environ["XDG_STATE_HOME"], ignore_errors=True)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark each test by what it needs; what needs nothing special and is not marked `slow` is `quick`."""
    for item in items:
        fixtures, module = getattr(item, "fixturenames", ()), getattr(item, "module", None)
        if item.path.is_relative_to(CLIENTS):
            item.add_marker("client")
        if any(map(item.path.is_relative_to, SLOW)):
            item.add_marker("slow")
        if "manipnet_data" in fixtures:
            item.add_marker("dataset")
        if {"stage", "studio"} & set(fixtures) or STARTS_PROCESSES & vars(module).keys():
            item.add_marker("process")
        if not {"client", "dataset", "process", "slow"} & {marker.name for marker in item.iter_markers()}:
            item.add_marker("quick")
    # what takes long goes first, so that no worker ends long after the rest
    items.sort(key=lambda item: item.get_closest_marker("quick") is not None)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """With `-n`, each worker takes whole files, because the servers that tests share live as long as a module."""
    from xdist.scheduler import LoadFileScheduling

    config.option.loadscopereorder = False  # files with many tests are not those that take long
    return LoadFileScheduling(config, log)


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
    folders = ("--dump-dir", str(dumps), "--takes", str(dumps / "takes"))
    with serving("--mesh", f"Box={LIBRARY_FOLDER / 'cube.ply'}", "--model", str(tiny_bundle), *folders) as server:
        stage = Stage(server)
        yield stage
        stage.close()


class Heard:
    """A sink; `next()` waits for the next frame and fails the test when none comes."""

    def __init__(self) -> None:
        self.frames: queue.Queue[BodyFrame] = queue.Queue()

    def __call__(self, frame: BodyFrame) -> None:
        self.frames.put(frame)

    def next(self) -> BodyFrame:
        return self.frames.get(timeout=PATIENCE_S)


@pytest.fixture
def heard():
    return Heard()


@pytest.fixture
def telemetry():
    return Telemetry()
