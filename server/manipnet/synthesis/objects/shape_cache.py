"""Files with the parts of a shape that take long to build: its volume hierarchy and its distance field."""

import logging
import os
import zipfile
import zlib
from contextlib import suppress
from pathlib import Path
from typing import Final

import numpy as np

from manipnet.common.atomic_file import replacing
from manipnet.synthesis.objects.bvh import Bvh
from manipnet.synthesis.objects.distance_field import Field

MAX_FOLDER_BYTES: Final = 512 << 20
"""The files of a folder that were used longest ago are deleted beyond this size, which is that of some 90 shapes."""
_log = logging.getLogger(__name__)


def read_cached(path: Path) -> tuple[Bvh, Field] | None:
    """The parts in a file; None if there is no file or it cannot be read."""
    try:
        with suppress(OSError):
            os.utime(path)  # the files that were used last are kept longest
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as data:
            bvh = Bvh(*(data[name] for name in Bvh._fields))
            return bvh, Field(data["origin"], float(data["cell_m"]), data["distance"], data["triangle"])
    except FileNotFoundError:
        return None
    except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile, zlib.error) as error:
        _log.warning("the cached shape %s is damaged (%s), so the shape is built again", path, error)
        return None


def write_cached(path: Path, bvh: Bvh, field: Field) -> None:
    """Write the parts of a shape, or log why that is not possible."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as file:
            np.savez(file, **bvh._asdict(), **field._asdict())
        _remove_oldest(path.parent)
    except OSError as error:
        _log.warning("the shape %s cannot be cached (%s), so the next start builds it again", path, error)


def _remove_oldest(folder: Path) -> None:
    """Delete the files that were used longest ago, as far as the folder is too large."""
    files: list[tuple[float, int, Path]] = []
    for path in folder.glob("*.npz*"):  # also what a process that was killed has written in part
        with suppress(OSError):  # another process has just deleted it
            stat = path.stat()
            files.append((stat.st_mtime, stat.st_size, path))
    excess = sum(size for _, size, _ in files) - MAX_FOLDER_BYTES
    for _, size, path in sorted(files):
        if excess <= 0:
            return
        with suppress(OSError):
            path.unlink()
        excess -= size
