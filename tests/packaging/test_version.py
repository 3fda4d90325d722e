"""The version stands in one place; what is distributed on its own repeats it."""

import json
import re
import tomllib
from pathlib import Path

import pytest

from manipnet import __version__

ROOT = Path(__file__).parents[2]


def of_toml(text: str) -> str:
    values = tomllib.loads(text)
    return values.get("project", values)["version"]


def of_citation(text: str) -> str:
    (version,) = re.findall(r"^version: (.*)$", text, re.M)
    return version


@pytest.mark.parametrize(
    ("file", "read"),
    [
        ("clients/python/pyproject.toml", of_toml),
        ("clients/blender/manipnet_live/blender_manifest.toml", of_toml),
        ("clients/unity/com.manipnet.client/package.json", lambda text: json.loads(text)["version"]),
        ("clients/unreal/ManipNetLiveLink/ManipNetLiveLink.uplugin", lambda text: json.loads(text)["VersionName"]),
        ("clients/web/package.json", lambda text: json.loads(text)["version"]),
        ("CITATION.cff", of_citation),
    ],
)
def test_every_distribution_has_the_version_of_the_server(file, read):
    assert read((ROOT / file).read_text(encoding="utf-8")) == __version__, f"{file}: see RELEASING.md"


def test_the_distribution_reads_its_version_from_the_package():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["project"]["dynamic"] == ["version"]
    assert project["tool"]["hatch"]["version"]["path"] == "server/manipnet/__init__.py"
