"""Where the files of the shipped hands are, for commands that take a profile; it loads no other module."""

from pathlib import Path
from typing import Final

FOLDER: Final = Path(__file__).parent / "assets"
NAMES: Final = ("generic", "adult", "child")


def hand_file(hand: Path | str, folder: Path | None = None) -> Path:
    """The file of a profile: `hand`, relative to `folder` if that is given, or the shipped hand of that name.

    A file comes first, so that nobody's file is hidden by a name. The file need not exist.
    """
    file = Path(hand) if folder is None else folder / hand
    return FOLDER / f"{hand}.json" if str(hand) in NAMES and not file.is_file() else file


def hand_name(file: Path) -> str | None:
    """The name of the shipped hand whose profile `file` is; None for any other file."""
    return file.stem if file.parent == FOLDER and file.stem in NAMES else None
