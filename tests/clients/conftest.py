"""Makes the Python client and the helpers beside this file importable."""

import functools
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
HERE = Path(__file__).parent
sys.path[:0] = [
    str(HERE),
    str(ROOT / "clients"),
    str(ROOT / "clients" / "python"),
    str(ROOT / "tests" / "vectors"),
]

from languages import build  # noqa: E402


@pytest.fixture(scope="session")
def harness(tmp_path_factory):
    """By name, the command of a language's client; each is built once."""
    return functools.cache(lambda name: build(name, tmp_path_factory.mktemp(name)))
