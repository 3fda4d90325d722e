"""What is imported is declared, and what is declared is imported."""

import ast
import re
import sys
import tomllib
from collections.abc import Iterable
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, packages_distributions, requires
from itertools import chain
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
OWN = {"manipnet", "manipnet_tools"}


def normal(name: str) -> str:
    """A distribution's name as package indexes compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def named(requirements: list[str]) -> set[str]:
    """The distributions that some requirements name."""
    return {normal(re.split(r"[\s\[<>=!~;]", requirement)[0]) for requirement in requirements}


def imported(folder: str) -> set[str]:
    """The distributions that the modules below a folder import, anywhere in a file."""
    modules: set[str] = set()
    for path in (ROOT / folder).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                modules |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module is not None:
                modules.add(node.module.split(".")[0])
    installed = packages_distributions()
    return {normal(installed.get(name, [name])[0]) for name in modules - sys.stdlib_module_names - OWN}


RUNTIME = named(PROJECT["dependencies"])
PINNED_EXTRAS = {name: extra for name, extra in PROJECT["optional-dependencies"].items() if name != "gpu"}
EXTRAS = named([one for extra in PINNED_EXTRAS.values() for one in extra])


OPTIONAL = {"dracopy", "pylsl"}
"""Libraries that a plain install lacks: where they are needed and missing, an error says how to install them."""


def test_the_server_imports_only_what_a_plain_install_brings():
    assert imported("server/manipnet") - RUNTIME == OPTIONAL


def test_the_tools_import_only_what_an_extra_or_a_plain_install_brings():
    assert imported("tools/manipnet_tools") - RUNTIME - EXTRAS == set()


def test_every_runtime_dependency_is_imported():
    assert RUNTIME - imported("server/manipnet") - imported("tools/manipnet_tools") == set()


LINES = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()


def pinned() -> list[str]:
    """The distributions that the constraints pin."""
    return [normal(line.split("==")[0]) for line in LINES if line and not line.startswith("#")]


def needed(requirements: Iterable[Requirement]) -> dict[str, str]:
    """What some requirements need on this platform, directly or not, and what names it. It stops at what is missing."""
    waiting, found, done = list(requirements), {}, set()
    while waiting:
        one = waiting.pop()
        if (str(one.name), frozenset(one.extras)) in done:
            continue
        done.add((str(one.name), frozenset(one.extras)))
        found[normal(one.name)] = str(one)
        with suppress(PackageNotFoundError):
            for each in map(Requirement, requires(one.name) or ()):
                environments = [{"extra": extra} for extra in one.extras or {""}]
                if each.marker is None or any(each.marker.evaluate(environment) for environment in environments):
                    waiting.append(each)
    return found


def test_the_constraints_pin_everything_that_an_installation_brings():
    extras = (requirements for requirements in PINNED_EXTRAS.values())
    declared = map(Requirement, chain(PROJECT["dependencies"], *extras))
    brought = needed(each for each in declared if each.name != "manipnet-live")
    of_cuda = re.compile(r"nvidia-.*|cuda-.*|triton")
    missing = {name: text for name, text in brought.items() if name not in pinned() and not of_cuda.fullmatch(name)}
    assert missing == {}, "RELEASING.md says how to refresh constraints.txt"


def test_the_constraints_pin_every_dependency_once():
    pins = [line for line in LINES if line and not line.startswith("#")]
    assert all(re.fullmatch(r"[A-Za-z0-9_.-]+==[A-Za-z0-9_.+!-]+( ;.*)?", pin) for pin in pins)
    assert len(pinned()) == len(set(pinned()))
