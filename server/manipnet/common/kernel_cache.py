"""Checks the folder in which numba keeps compiled code: numba crashes when it reads a file that was cut off.

A manifest holds the SHA-256 of every file, and is written when everything is compiled. A file that has
changed since, perhaps because another process added it, gets a lighter check: numba's files are pickles, and all of
their instructions must be there up to the last byte. Nothing is unpickled here.
"""

import hashlib
import io
import json
import logging
import pickletools
import shutil
from pathlib import Path
from typing import Final

from manipnet.common.atomic_file import replacing

MANIFEST: Final = "manifest.json"
_SUFFIXES: Final = (".nbi", ".nbc")
_log = logging.getLogger(__name__)

_Entry = tuple[int, int, str]
"""Size, time of the last change in nanoseconds, and SHA-256."""


def check_cache(folder: Path) -> None:
    """Delete what is damaged, so that it is compiled again, and log it. Raises `OSError` if that is not possible."""
    known = _read_manifest(folder / MANIFEST)
    damaged = [path for path in _files(folder) if not _is_whole(path, known.get(_name(folder, path)))]
    if not damaged:
        return
    _log.warning(
        "%d files of compiled code in %s are damaged (%s, for example) and are compiled again; this start takes longer",
        len(damaged),
        folder,
        damaged[0].name,
    )
    for index in {path.with_name(_function(path)) for path in damaged}:
        for path in index.parent.glob(f"{_escaped(index.name)}.*"):
            _delete(path)


def seal_cache(folder: Path) -> None:
    """Write the manifest of the folder as it is now, unless nothing has changed; logs why that is not possible."""
    try:
        known = _read_manifest(folder / MANIFEST)
        entries: dict[str, _Entry] = {}
        for path in _files(folder):
            name, stamp = _name(folder, path), _stamp(path)
            before = known.get(name)
            entries[name] = before if before is not None and before[:2] == stamp else (*stamp, _digest(path))
        if entries != known:
            with replacing(folder / MANIFEST) as file:
                file.write(json.dumps(entries, indent=0).encode("ascii"))
    except OSError as error:
        _log.warning("the compiled code in %s cannot be sealed against damage: %s", folder, error)


def _is_whole(path: Path, known: _Entry | None) -> bool:
    try:
        if known is not None and known[:2] == _stamp(path):
            return known[2] == _digest(path)
        return _has_whole_pickles(path.read_bytes())
    except FileNotFoundError:  # another process has just replaced it
        return True
    except OSError:  # a folder, for example, or a block of the disk that cannot be read
        return False


def _has_whole_pickles(content: bytes) -> bool:
    """Whether bytes are one pickle or several. Their instructions are decoded, but not followed."""
    file = io.BytesIO(content)
    try:
        while file.tell() < len(content):
            for _ in pickletools.genops(file):
                pass
    except Exception:  # whatever a damaged argument of an instruction leads to
        return False
    return bool(content)


def _delete(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _read_manifest(path: Path) -> dict[str, _Entry]:
    """The entries of a manifest; empty if there is none that can be read."""
    try:
        entries = json.loads(path.read_bytes())
        return {
            str(name): (int(size), int(changed_ns), str(digest)) for name, (size, changed_ns, digest) in entries.items()
        }
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, TypeError, AttributeError) as error:
        _log.warning("%s is damaged (%s) and is written again", path, error)
        return {}


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.suffix in _SUFFIXES)


def _function(path: Path) -> str:
    """What the names of all files of one function begin with: `NAME.nbi` is its index, `NAME.1.nbc` has code."""
    return path.stem if path.suffix == ".nbi" else path.stem.rpartition(".")[0]


def _escaped(name: str) -> str:
    return "".join(f"[{letter}]" if letter in "*?[" else letter for letter in name)


def _name(folder: Path, path: Path) -> str:
    return path.relative_to(folder).as_posix()


def _stamp(path: Path) -> tuple[int, int]:
    stat = path.stat()
    return stat.st_size, stat.st_mtime_ns


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
