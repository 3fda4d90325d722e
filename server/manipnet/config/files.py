"""Checks that files exist. They need no library, so that a mistyped path is reported before anything loads."""

import difflib
from pathlib import Path

from manipnet.common.options import ConfigError
from manipnet.config.settings import ServerConfig
from manipnet.synthesis.hand.shipped_files import NAMES, hand_file
from manipnet.synthesis.model.shipped import find_bundle
from manipnet.synthesis.objects.library import library_names


def check_files(config: ServerConfig) -> None:
    """Raise `ConfigError` unless the meshes can be opened, and `BundleError` unless the model exists."""
    find_bundle(config.model)
    for actor in config.actors:
        require_hand(actor.hand)
        for prop in actor.objects:
            require_mesh(prop.mesh)


def require_hand(path: Path | None) -> None:
    """Raise `ConfigError` unless the hand profile, a file or the name of a shipped one, can be opened.

    None stands for an option that was not given.
    """
    try:
        require_file(None if path is None else hand_file(path))
    except ConfigError as error:
        raise ConfigError(f"{error}; shipped hands are {', '.join(NAMES)}") from None


def require_file(path: Path | None) -> None:
    """Raise `ConfigError` unless the file can be opened. None stands for an option that was not given."""
    if path is None:
        return
    try:
        path.open("rb").close()
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror or error})") from None


def require_mesh(path: Path, where: str = "") -> None:
    """Raise `ConfigError` unless the mesh file can be opened. `where` is the option or key that names it."""
    prefix = f"{where}: " if where else ""
    if not path.suffix and not path.exists():
        names = library_names()
        near = difflib.get_close_matches(path.name, names, 1)
        guess = f" (did you mean {near[0]}?)" if near else ""
        raise ConfigError(
            f"{prefix}{path} is neither a file nor an object of the library{guess}, which has {', '.join(names)}"
        )
    try:
        require_file(path)
    except ConfigError as error:
        raise ConfigError(f"{prefix}{error}") from None
