"""The public API is complete, documented, typed, and light until it is used."""

import subprocess
import sys
from pathlib import Path

import manipnet

ROOT = Path(__file__).parents[2]


def test_every_public_name_is_there_and_documented():
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    for name in manipnet.__all__:
        assert name in dir(manipnet)
        assert getattr(manipnet, name) is not None
        assert f"`{name}" in page, f"docs/api.md does not mention {name}"


def test_an_unknown_name_is_an_ordinary_error():
    assert not hasattr(manipnet, "Hands")


def test_importing_the_package_loads_no_library():
    code = "import sys, manipnet; sys.exit(bool({'numpy', 'numba', 'onnxruntime', 'zmq'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_packages_say_that_they_are_typed():
    for package in ("server/manipnet", "tools/manipnet_tools"):
        assert (ROOT / package / "py.typed").is_file()
