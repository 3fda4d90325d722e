"""What is imported is declared, and what is declared is imported."""

import ast
import re
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

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
EXTRAS = named(PINNED_EXTRAS["train"]) | named(PINNED_EXTRAS["cluster"])


def test_the_server_imports_only_what_a_plain_install_brings():
    assert imported("server/manipnet") - RUNTIME == set()


def test_the_tools_import_only_what_an_extra_or_a_plain_install_brings():
    assert imported("tools/manipnet_tools") - RUNTIME - EXTRAS == set()


def test_every_runtime_dependency_is_imported():
    assert RUNTIME - imported("server/manipnet") - imported("tools/manipnet_tools") == set()


def test_the_constraints_pin_every_dependency_once():
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = [line for line in lines if line and not line.startswith("#")]
    assert all(re.fullmatch(r"[A-Za-z0-9_.-]+==[A-Za-z0-9_.+!-]+( ;.*)?", pin) for pin in pins)
    names = [normal(pin.split("==")[0]) for pin in pins]
    assert len(names) == len(set(names))
    declared = RUNTIME.union(*(named(requirements) for requirements in PINNED_EXTRAS.values()))
    assert declared - {"manipnet-live"} <= set(names)
