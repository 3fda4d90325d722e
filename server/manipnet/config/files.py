"""Checks that files exist. They need no library, so that a mistyped path is reported before anything loads."""

from pathlib import Path

from manipnet.common.options import ConfigError
from manipnet.config.settings import ServerConfig
from manipnet.synthesis.hand.shipped_files import NAMES, hand_file
from manipnet.synthesis.model.shipped import find_bundle


def check_files(config: ServerConfig) -> None:
    """Raise `ConfigError` unless the meshes can be opened, and `BundleError` unless the model exists."""
    find_bundle(config.model)
    for actor in config.actors:
        require_hand(actor.hand)
        for prop in actor.objects:
            require_file(prop.mesh)


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
