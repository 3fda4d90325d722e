"""The Dockerfile, checked by its steps; CI also builds the wheel of its context, installs it and runs its command."""

import re
import runpy
from pathlib import Path

from manipnet.cli import build_parser
from manipnet.common.options import Port
from manipnet.config.settings import all_options

ROOT = Path(__file__).parents[2]
CONTAINER = runpy.run_path(str(ROOT / ".ci" / "container.py"))
STEPS: list[tuple[str, str]] = list(CONTAINER["instructions"]())


def test_the_image_gets_everything_that_it_installs(tmp_path: Path) -> None:
    CONTAINER["copy"](tmp_path)
    (install,) = [rest for word, rest in STEPS if word == "RUN" and "pip install" in rest]
    assert (tmp_path / install.split(" -c ")[1].split()[0]).is_file()
    assert install.split()[-2:] == [".", "./models"]
    for needed in (
        "pyproject.toml",
        "README.md",
        "LICENSE",
        "models/LICENSE",
        "models/pyproject.toml",
        "tools/manipnet_tools/cli.py",
    ):
        assert (tmp_path / needed).is_file(), needed
    for package in ("server", "tools", "models"):
        assert files_of(tmp_path / package) == files_of(ROOT / package)


def files_of(folder: Path) -> set[str]:
    return {str(file.relative_to(folder)) for file in folder.rglob("*") if "__pycache__" not in file.parts}


def test_the_container_exposes_the_ports_of_the_server_and_does_not_run_as_root() -> None:
    (exposed,) = [rest for word, rest in STEPS if word == "EXPOSE"]
    defaults = {str(each.default) for each in all_options().values() if isinstance(each.kind, Port)}
    assert set(re.findall(r"\d+", exposed)) <= defaults
    words = [word for word, _ in STEPS]
    users = [rest for word, rest in STEPS if word == "USER"]
    assert users == ["manipnet"]
    assert words.index("USER") < words.index("ENTRYPOINT")
    assert any(word == "RUN" and "useradd" in rest and rest.endswith(users[0]) for word, rest in STEPS)


def test_the_command_of_the_container_is_one_of_the_server() -> None:
    program, *arguments = CONTAINER["command"]()
    assert program == "manipnet-serve"
    assert build_parser().parse_args(arguments).demo


def test_the_python_of_the_image_is_supported() -> None:
    (base,) = [rest for word, rest in STEPS if word == "FROM"]
    found = re.fullmatch(r"python:(\d+)\.(\d+)-slim", base)
    assert found is not None
    lowest = re.search(r'requires-python = ">=(\d+)\.(\d+)"', (ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert lowest is not None
    assert tuple(map(int, found.groups())) >= tuple(map(int, lowest.groups()))
