"""What is distributed on its own repeats the version and the authors, each of which stands in one place."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

from manipnet import __version__

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
MANIFESTS = {
    "clients/python/pyproject.toml": ("project.version", "project.authors.0.name"),
    "clients/blender/manipnet_live/blender_manifest.toml": ("version", "maintainer"),
    "clients/unity/com.manipnet.client/package.json": ("version", "author.name"),
    "clients/unreal/ManipNetLiveLink/ManipNetLiveLink.uplugin": ("VersionName", "CreatedBy"),
    "clients/web/package.json": ("version", "author"),
}
"""Where each manifest has the version and the authors."""


def value_at(content: Any, place: str) -> Any:
    """The value at a dotted place of nested maps and lists."""
    for key in place.split("."):
        content = content[int(key) if key.isdecimal() else key]
    return content


@pytest.mark.parametrize("file", MANIFESTS)
def test_every_manifest_has_the_version_and_the_authors_of_the_server(file: str) -> None:
    text = (ROOT / file).read_text(encoding="utf-8")
    content = tomllib.loads(text) if file.endswith(".toml") else json.loads(text)
    version, authors = (value_at(content, place) for place in MANIFESTS[file])
    assert version == __version__, "RELEASING.md lists the files to change"
    assert authors == PROJECT["project"]["authors"][0]["name"]


def test_the_citation_has_the_version_and_the_authors_of_the_server() -> None:
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (.*)$", text, re.M) == [__version__]
    assert re.findall(r"^authors:\n  - name: (.*)$", text, re.M) == [PROJECT["project"]["authors"][0]["name"]]


def test_the_distribution_reads_its_version_from_the_package() -> None:
    assert PROJECT["project"]["dynamic"] == ["version"]
    assert PROJECT["tool"]["hatch"]["version"]["path"] == "server/manipnet/__init__.py"
