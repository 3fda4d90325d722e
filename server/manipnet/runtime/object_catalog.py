"""The objects that a server knows or can load, by name: their shapes, each of which is built once while in use."""

import logging
import threading
import weakref
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from manipnet.runtime.shape_process import make_shape
from manipnet.synthesis.objects.foreign import SUFFIXES, foreign_format
from manipnet.synthesis.objects.library import library_file, library_names
from manipnet.synthesis.objects.mesh import FORMATS, MeshError
from manipnet.synthesis.objects.shape import Shape, load_shape

MAX_FOLDER_FILES: Final = 1000
MAX_UNUSED: Final = 16
"""Shapes that are kept although nobody may carry them: those that were requested last."""
MAX_UNUSED_TRIANGLES: Final = 600_000
"""Triangles of these shapes together, which take about 270 MB; the newest is kept whatever its size."""
Build = Callable[[Path, str, float], Shape]
"""Makes a shape of a file, a unit and a scale. Raises `MeshError`."""
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Source:
    """A mesh file, and how it is read."""

    path: Path
    unit: str = "m"
    scale: float = 1.0


class ObjectCatalog:
    """Shapes of the rig, of the user's `folder` and of the library. Thread-safe.

    A shape is built on the thread that first requests it. It is kept while it is in use, and while it is among the
    `MAX_UNUSED` that were requested last. An object that a client has added is forgotten with its shape.

    If two objects have the same name, the rig's comes before the folder's, and the folder's before the library's.
    """

    def __init__(self, folder: Path | None = None, unit: str = "m", build: Build = make_shape) -> None:
        """`unit` is the unit of the folder's files; `build` makes a shape of a file, a unit and a scale."""
        self._folder, self._unit, self._build_shape = folder, unit, build
        self._lock = threading.Lock()
        self._building = threading.Lock()
        self._sources: dict[str, Source] = {}
        self._of_rig: set[Source] = set()
        self._shapes: weakref.WeakValueDictionary[Source, Shape] = weakref.WeakValueDictionary()
        self._newest: deque[Shape] = deque()
        self._stamps: dict[Source, tuple[int, int]] = {}
        self._unsettled: dict[Source, tuple[int, int]] = {}
        self._problems: dict[Source, str] = {}

    def load(self, file: Path, unit: str = "m", scale: float = 1.0) -> Shape:
        """The shape of a mesh file, which is an object from now on unless its name is taken. Raises `MeshError`.

        No tick may run yet, because the file is read in this process, which is faster than to start another one.
        """
        source = Source(file.resolve(), unit, scale)
        shape = self._built(source, load_shape)
        with self._lock:
            self._sources.setdefault(shape.name, source)
            self._of_rig.add(source)
        return shape

    def add(self, file: Path, unit: str = "m") -> Shape:
        """Add a mesh file; it replaces an object of the same name. Raises `MeshError`."""
        source = Source(file.resolve(), unit)
        with self._lock:
            self._shapes.pop(source, None)
        shape = self._built(source)
        with self._lock:
            self._forget_unused()
            self._sources[shape.name] = source
        return shape

    def names(self) -> tuple[str, ...]:
        """The names of all objects, in order."""
        with self._lock:
            self._forget_unused()
            loaded = tuple(self._sources)
        return tuple(sorted({*loaded, *self._folder_files(), *library_names()}))

    def source(self, name: str) -> Source | None:
        """The file of an object, and how it is read; None if there is no such object."""
        with self._lock:
            source = self._sources.get(name)
        if source is None and (file := self._folder_files().get(name)) is not None:
            source = Source(file.resolve(), self._unit)
        if source is None and (file := library_file(name)) is not None:
            source = Source(file)
        return source

    def shape(self, name: str) -> Shape:
        """The shape of an object, which is built on first use. Raises `MeshError`."""
        source = self.source(name)
        if source is None:
            raise MeshError(f"object {name!r} is unknown; allowed are {', '.join(self.names())}")
        return self._built(source)

    def shapes(self) -> tuple[Shape, ...]:
        """The shapes that are built so far."""
        with self._lock:
            return tuple(self._shapes.values())

    def problems(self) -> dict[str, str]:
        """By file name, why the newest content of a file cannot be used; the shape from before stays in use.

        Files of the folder are among them that are meshes of formats that are not read, or that share a name.
        """
        files = self._files()
        problems = {path.name: f"{path}: {reason}" for path in files if (reason := _foreign(path)) is not None}
        for same in _by_name(files).values():
            if len(same) > 1:
                names = " and ".join(path.name for path in same)
                problems |= {path.name: f"{names} would be the same object; rename one of them" for path in same}
        with self._lock:
            return problems | {source.path.name: text for source, text in self._problems.items()}

    def changed(self) -> list[tuple[Shape, Shape]]:
        """Build the shapes of changed files again; returns the old and the new shape of each.

        A file counts as changed when it has stayed the same since the last call, so that nobody is still writing it.
        """
        with self._lock:
            shapes = tuple(self._shapes.items())
        pairs = [(shape, self._rebuilt(source)) for source, shape in shapes if self._has_settled(source)]
        return [(old, new) for old, new in pairs if new is not None and new.content_hash != old.content_hash]

    def _folder_files(self) -> dict[str, Path]:
        """The files of the folder by the names of their objects, without those that share a name."""
        return {name: same[0] for name, same in _by_name(self._files()).items() if len(same) == 1}

    def _files(self) -> list[Path]:
        if self._folder is None:
            return []
        try:
            return sorted(self._folder.iterdir())[:MAX_FOLDER_FILES]
        except OSError:
            return []

    def _has_settled(self, source: Source) -> bool:
        """Whether a file differs from what was built and has not changed since the last look."""
        stamp = _stamp(source.path)
        before = self._unsettled.pop(source, None)
        if stamp is None or stamp == self._stamps.get(source):
            return False
        if stamp != before:
            self._unsettled[source] = stamp
        return stamp == before

    def _built(self, source: Source, build: Build | None = None) -> Shape:
        if (shape := self._known(source)) is not None:
            return shape
        with self._building:  # one shape at a time, and this one may have been built meanwhile
            return self._known(source) or self._build(source, build or self._build_shape)

    def _known(self, source: Source) -> Shape | None:
        with self._lock:
            shape = self._shapes.get(source)
            if shape is not None:
                self._keep(shape)
            return shape

    def _rebuilt(self, source: Source) -> Shape | None:
        try:
            with self._building:
                shape = self._build(source, self._build_shape)
        except MeshError as error:
            _log.warning("a mesh file has changed, but its new content cannot be used: %s", error)
            with self._lock:
                self._problems[source] = str(error)
            return None
        _log.warning("%s has changed and is loaded again", source.path)
        return shape

    def _build(self, source: Source, build: Build) -> Shape:
        stamp = _stamp(source.path) or (0, 0)
        shape = build(source.path, source.unit, source.scale)
        _ = shape.rays  # a tick must not be the first to ask for them
        with self._lock:
            self._shapes[source], self._stamps[source] = shape, stamp
            self._keep(shape)
            self._problems.pop(source, None)
        return shape

    def _keep(self, shape: Shape) -> None:
        """Note that a shape was requested; those that were requested longest ago may go instead."""
        if shape in self._newest:
            self._newest.remove(shape)
        self._newest.append(shape)
        while len(self._newest) > MAX_UNUSED or len(self._newest) > 1 < _triangles(self._newest) / MAX_UNUSED_TRIANGLES:
            self._newest.popleft()

    def _forget_unused(self) -> None:
        """Forget the added objects whose shapes are gone, and what is known of their files."""
        known = self._of_rig | set(self._shapes)
        self._sources = {name: source for name, source in self._sources.items() if source in known}
        for notes in (self._stamps, self._unsettled, self._problems):
            for source in [source for source in notes if source not in known]:
                del notes[source]


def _triangles(shapes: Iterable[Shape]) -> int:
    return sum(len(shape.mesh.faces) for shape in shapes)


def _by_name(files: list[Path]) -> dict[str, list[Path]]:
    """The mesh files by the names of their objects."""
    found: dict[str, list[Path]] = {}
    for path in files:
        if path.suffix.lower() in FORMATS:
            found.setdefault(path.stem, []).append(path)
    return found


def _foreign(path: Path) -> str | None:
    """Why a file that is called like a mesh of another format cannot be read."""
    return foreign_format(path) if path.suffix.lower() in SUFFIXES else None


def _stamp(path: Path) -> tuple[int, int] | None:
    """Numbers that change with a file's content; None if there is no file."""
    try:
        stat = path.stat()
    except OSError:
        return None
    return stat.st_mtime_ns, stat.st_size
