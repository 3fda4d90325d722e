"""Compiled kernels that are part of an installation, so that its first start does not have to compile.

`manipnet.runtime.precompile` writes them into a folder `INTERPRETER-PLATFORM-STATE` with the package's folders.
A start copies them into the user's cache, in which numba names a folder after the path of its sources. The state stands
for everything on which compiled code depends (`manipnet.jit`), so kernels of another state are never used.
"""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from numba.core import caching

from manipnet.common.shipped_folder import FOLDER, interpreter_and_platform


def can_ship() -> bool:
    """Whether this numba recognises sources by their content. Older ones take the time of their last change."""
    return hasattr(caching, "_hash_source_file")


def use_shipped(package: Path, state: str, cache: Path) -> None:
    """Copy the shipped kernels of a state, if there are any, into an empty cache. Raises `OSError`."""
    shipped = package / FOLDER / f"{interpreter_and_platform()}-{state}"
    if not shipped.is_dir() or any(cache.rglob("*.nbi")):
        return
    for sources, folder in _folders(package, cache):
        for file in sorted((shipped / sources).glob("*.nb[ic]"), reverse=True):  # code before the index that names it
            folder.mkdir(exist_ok=True)
            part = folder / f".{file.name}.{os.getpid()}.part"
            part.write_bytes(file.read_bytes())
            part.replace(folder / file.name)


def ship(package: Path, state: str, cache: Path, into: Path) -> int:
    """Write the kernels of a cache below a folder, which becomes `kernels` of a package; returns the number of files.

    Those of other states, but of the same interpreter and platform, are removed.
    """
    tag, count = interpreter_and_platform(), 0
    for old in into.glob(f"{tag}-*"):
        shutil.rmtree(old)
    for sources, folder in _folders(package, cache):
        for file in folder.glob("*.nb[ic]"):
            place = into / f"{tag}-{state}" / sources
            place.mkdir(parents=True, exist_ok=True)
            (place / file.name).write_bytes(file.read_bytes())
            count += 1
    return count


def _folders(package: Path, cache: Path) -> Iterator[tuple[Path, Path]]:
    """Each folder of the package, relative to it, and the folder in which numba caches its functions."""
    for place, folders, _ in os.walk(package):
        folders[:] = [name for name in folders if name not in ("__pycache__", FOLDER)]
        sources = Path(place)
        named = caching.UserProvidedCacheLocator.get_suitable_cache_subpath(str(sources / "module.py"))
        yield sources.relative_to(package), cache / named
