"""Compiled kernels that an installation brings along: its first start finds them, and compiles nothing."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba.core import config

import manipnet
from manipnet.common.kernel_target import choose_target
from manipnet.common.shipped_folder import FOLDER, brings_kernels, interpreter_and_platform
from manipnet.common.shipped_kernels import can_ship, ship, use_shipped
from manipnet.jit import ship_kernels
from manipnet.synthesis.hand.limits import keep_angles

CALL = """
import json, numpy as np
from manipnet.synthesis.hand.limits import keep_angles
keep_angles(np.ones(2), np.array([[0.0, 2.0]] * 2), np.ones(2), 1.0, np.empty(2))
print(json.dumps([sum(keep_angles.stats.cache_hits.values()), sum(keep_angles.stats.cache_misses.values())]))
"""


@pytest.fixture
def installation(tmp_path: Path) -> Path:
    """The package in another place, with what this process has compiled."""
    keep_angles(np.ones(2), np.array([[0.0, 2.0]] * 2), np.ones(2), 1.0, np.empty(2))
    package = tmp_path / "site" / "manipnet"
    shutil.copytree(Path(manipnet.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__", FOLDER))
    return package


@pytest.mark.skipif(not can_ship(), reason="needs a numba that recognises sources by their content")
def test_another_installation_finds_the_kernels_that_it_brings_along(installation: Path, tmp_path: Path) -> None:
    assert not brings_kernels(installation)
    assert ship_kernels(installation / FOLDER) > 0
    assert brings_kernels(installation)
    assert called(installation, tmp_path / "cache") == [1, 0]


@pytest.mark.skipif(not can_ship(), reason="needs a numba that recognises sources by their content")
def test_kernels_of_other_sources_are_not_used(installation: Path, tmp_path: Path) -> None:
    ship_kernels(installation / FOLDER)
    with (installation / "geometry.py").open("a") as file:
        file.write("ONE_MORE = 1\n")
    assert called(installation, tmp_path / "cache") == [0, 1]


def test_kernels_go_into_an_empty_cache_only_and_old_ones_are_not_shipped(tmp_path: Path) -> None:
    package, cache, empty, into = (tmp_path / name for name in ("package", "cache", "empty", "into"))
    (package / "tracking").mkdir(parents=True)
    empty.mkdir()
    for state, content in (("old", b"1"), ("new", b"2")):
        use_shipped(package, state, empty)
        assert not list(empty.iterdir())
        here = folder_of(package / "tracking", cache)
        here.mkdir(parents=True, exist_ok=True)
        (here / "a.f-1.nbi").write_bytes(content)
        assert ship(package, state, cache, into) == 1
    assert [path.name for path in into.iterdir()] == [f"{interpreter_and_platform()}-new"]
    into.rename(package / FOLDER)
    use_shipped(package, "new", empty)
    assert (folder_of(package / "tracking", empty) / "a.f-1.nbi").read_bytes() == b"2"
    (folder_of(package / "tracking", empty) / "a.f-1.nbi").write_bytes(b"3")
    use_shipped(package, "new", empty)
    assert (folder_of(package / "tracking", empty) / "a.f-1.nbi").read_bytes() == b"3"


def test_the_target_stays_the_same_and_can_be_given(monkeypatch: pytest.MonkeyPatch) -> None:
    assert choose_target() == choose_target()
    monkeypatch.setattr(config, "CPU_NAME", "generic")
    assert choose_target().startswith("generic ")


def folder_of(sources: Path, cache: Path) -> Path:
    """Where numba caches the functions of a folder."""
    from numba.core.caching import UserProvidedCacheLocator

    return cache / UserProvidedCacheLocator.get_suitable_cache_subpath(str(sources / "a.py"))


def called(installation: Path, cache: Path) -> list[int]:
    """How many kernels were found in the cache, and how many were compiled, when an installation calls one."""
    environment = {**os.environ, "PYTHONPATH": str(installation.parent), "MANIPNET_CACHE": str(cache)}
    done = subprocess.run([sys.executable, "-c", CALL], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
