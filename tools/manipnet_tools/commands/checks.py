"""Checks of options that need no library, so that a mistyped path is reported before anything loads."""

from collections.abc import Sequence
from pathlib import Path

from manipnet.common.options import ConfigError
from manipnet.config.files import require_file
from manipnet.config.settings import parse_mesh
from manipnet.synthesis.model.providers import MAX_LOOK_AHEAD_S


def require_take(path: Path) -> None:
    """Raise `ConfigError` unless there is a file or a folder."""
    if not path.exists():
        raise ConfigError(f"{path}: no such take")


def require_meshes(texts: Sequence[str]) -> None:
    """Raise `ConfigError` unless each text is NAME=FILE, and each file can be opened."""
    for text in texts:
        require_file(parse_mesh(text)[1])


def require_folder_of(path: Path | None, option: str = "--out") -> None:
    """Raise `ConfigError` unless the folder exists in which an option's file is to be written."""
    if path is not None and not path.absolute().parent.is_dir():
        raise ConfigError(f"{option} {path}: its folder does not exist; create it first")


def require_new_file(path: Path) -> None:
    """Raise `ConfigError` if the file to write exists already, or if its folder does not exist."""
    require_folder_of(path)
    if path.exists():
        raise ConfigError(f"--out {path}: already exists; give another name, or delete it first")


def require_look_ahead(seconds: float) -> None:
    """Raise `ConfigError` unless a model can look so far ahead."""
    if not 0.0 <= seconds <= MAX_LOOK_AHEAD_S:
        raise ConfigError(f"--look-ahead is {seconds:g} s; allowed are 0 to {MAX_LOOK_AHEAD_S:g}")
