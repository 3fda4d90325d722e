"""Names of recordings that other programs give: made safe, and never that of a file which exists."""

import re
import time
from pathlib import Path
from typing import Final

from manipnet.common.file_names import is_device, is_encodable

NAME: Final = re.compile(r"\w([\w .-]{0,62}[\w-])?")
MOST: Final = 64
"""Characters of a name."""
MAX_BYTES: Final = 200
"""Bytes of a name, which file systems limit to 255 with the suffix and a number."""
SUFFIX: Final = ".mcap"


def time_name() -> str:
    """The name of a recording for which nobody gives one."""
    return time.strftime("take %Y-%m-%d %H.%M.%S")


def safe_name(text: str, folder: Path) -> str:
    """A name for a file in `folder` that resembles a text; that of the time if nothing of the text can be used."""
    name = re.sub(r"[^\w .-]+", "_", text.strip().removesuffix(SUFFIX)).lstrip(" .-")[:MOST]
    while len(name.encode("utf-8", "replace")) > MAX_BYTES:
        name = name[:-1]
    name = name.rstrip(" .")
    if not is_encodable(folder / name):
        name = name.encode("ascii", "replace").decode().replace("?", "_")
    if is_device(name):
        name = f"_{name}"[:MOST]
    return name if NAME.fullmatch(name) else time_name()


def free_path(folder: Path, name: str) -> Path:
    """The file of that name in `folder`, with a number if there is one already: `Take 1`, `Take 1_2`, `Take 1_3`."""
    path, number = folder / f"{name}{SUFFIX}", 2
    while path.exists():
        path, number = folder / f"{name}_{number}{SUFFIX}", number + 1
    return path
