"""Files with what takes long to make: closed meshes, and the volume hierarchies and distance fields of shapes."""

import logging
import os
import zipfile
import zlib
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import numpy as np

from manipnet.common.atomic_file import replacing
from manipnet.synthesis.objects.bvh import Bvh
from manipnet.synthesis.objects.distance_field import Field

MAX_FOLDER_BYTES: Final = 512 << 20
"""The files of a folder that were used longest ago are deleted beyond this size, which is that of some 90 shapes."""
_log = logging.getLogger(__name__)


def read_cached(path: Path) -> tuple[Bvh, Field] | None:
    """The parts of a shape in a file; None if there is no file or it cannot be read."""
    arrays = read_arrays(path, (*Bvh._fields, *Field._fields))
    if arrays is None:
        return None
    origin, cell_m, distance, triangle = arrays[len(Bvh._fields) :]
    return Bvh(*arrays[: len(Bvh._fields)]), Field(origin, float(cell_m), distance, triangle)


def write_cached(path: Path, bvh: Bvh, field: Field) -> None:
    """Write the parts of a shape, or log why that is not possible."""
    write_arrays(path, **bvh._asdict(), **field._asdict())


def read_arrays(path: Path, names: Sequence[str]) -> list[np.ndarray] | None:
    """Arrays of a file in the cache, by their names; None if there is no file or it cannot be read."""
    try:
        with suppress(OSError):
            os.utime(path)  # the files that were used last are kept longest
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as data:
            return [data[name] for name in names]
    except FileNotFoundError:
        return None
    except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile, zlib.error) as error:
        _log.warning("the cached file %s is damaged (%s), so its content is made again", path, error)
        return None


def write_arrays(path: Path, **arrays: Any) -> None:
    """Write a file of the cache, or log why that is not possible."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as file:
            np.savez(file, **arrays)
        _remove_oldest(path.parent)
    except OSError as error:
        _log.warning("%s cannot be written (%s), so the next start makes its content again", path, error)


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
