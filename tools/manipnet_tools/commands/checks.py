"""Checks of options that need no library, so that a mistyped path is reported before anything loads."""

from collections.abc import Sequence
from pathlib import Path

from manipnet.common.options import ConfigError
from manipnet.config.files import require_mesh
from manipnet.config.settings import parse_mesh
from manipnet.synthesis.model.providers import MAX_LOOK_AHEAD_S


def require_take(path: Path) -> None:
    """Raise `ConfigError` unless there is a file or a folder."""
    if not path.exists():
        raise ConfigError(f"{path}: no such take")


def require_meshes(texts: Sequence[str]) -> None:
    """Raise `ConfigError` unless each text is NAME=FILE, and each file can be opened."""
    for text in texts:
        require_mesh(parse_mesh(text)[1], f"--mesh {text}")


def require_folder_of(path: Path | None, option: str = "--out") -> None:
    """Raise `ConfigError` unless the folder exists in which an option's file is to be written."""
    if path is not None and not path.absolute().parent.is_dir():
        raise ConfigError(f"{option} {path}: its folder does not exist; create it first")


def require_new(path: Path | None, force: bool, option: str = "--out") -> None:
    """Raise `ConfigError` if an option's file exists already, unless `force` says to replace it.

    The same rule holds for every verb, and a folder for the file must exist. None stands for no file.
    """
    require_folder_of(path, option)
    if path is not None and path.exists() and not force:
        raise ConfigError(already_exists(f"{option} {path}"))


def require_new_bundle(folder: Path, force: bool, option: str = "--out") -> None:
    """Raise `ConfigError` if there is a bundle in an option's folder already, unless `force` says to replace it."""
    if (folder / "bundle.json").exists() and not force:
        raise ConfigError(already_exists(f"{option} {folder}: a bundle"))


def already_exists(what: str) -> str:
    """The sentence about a file that would be replaced."""
    return f"{what}: already exists; give another name, or --force to replace it"


def require_suffix(path: Path, *suffixes: str) -> None:
    """Raise `ConfigError` unless the file of `--out` ends in one of the suffixes."""
    if path.suffix.lower() not in suffixes:
        raise ConfigError(f"--out {path}: must end in {' or '.join(suffixes)}")


def require_look_ahead(seconds: float) -> None:
    """Raise `ConfigError` unless a model can look so far ahead."""
    if not 0.0 <= seconds <= MAX_LOOK_AHEAD_S:
        raise ConfigError(f"--look-ahead is {seconds:g} s; allowed are 0 to {MAX_LOOK_AHEAD_S:g}")
