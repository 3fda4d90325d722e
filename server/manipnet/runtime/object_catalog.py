"""The objects that a server knows or can load, by name: their shapes, each of which is built once."""

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from manipnet.runtime.shape_process import make_shape
from manipnet.synthesis.objects.library import library_file, library_names
from manipnet.synthesis.objects.mesh import FORMATS, MeshError
from manipnet.synthesis.objects.shape import Shape

MAX_FOLDER_FILES: Final = 1000
_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Source:
    """A mesh file, and how it is read."""

    path: Path
    unit: str = "m"
    scale: float = 1.0


class ObjectCatalog:
    """Shapes of the rig, of the user's `folder` and of the library. Thread-safe.

    A shape is built on the thread that first asks for it. If two objects have the same name, the rig's comes before the
    folder's, and the folder's before the library's.
    """

    def __init__(
        self, folder: Path | None = None, unit: str = "m", build: Callable[[Path, str, float], Shape] = make_shape
    ) -> None:
        """`unit` is the unit of the folder's files; `build` makes a shape of a file, a unit and a scale."""
        self._folder, self._unit, self._build_shape = folder, unit, build
        self._lock = threading.Lock()
        self._building = threading.Lock()
        self._sources: dict[str, Source] = {}
        self._shapes: dict[Source, Shape] = {}
        self._stamps: dict[Source, tuple[int, int]] = {}
        self._unsettled: dict[Source, tuple[int, int]] = {}
        self._problems: dict[str, str] = {}

    def load(self, file: Path, unit: str = "m", scale: float = 1.0) -> Shape:
        """The shape of a mesh file, which is an object from now on unless its name is taken. Raises `MeshError`."""
        source = Source(file.resolve(), unit, scale)
        shape = self._built(source)
        with self._lock:
            self._sources.setdefault(shape.name, source)
        return shape

    def add(self, file: Path, unit: str = "m") -> Shape:
        """Add a mesh file; it replaces an object of the same name. Raises `MeshError`."""
        source = Source(file.resolve(), unit)
        with self._lock:
            self._shapes.pop(source, None)
        shape = self._built(source)
        with self._lock:
            self._sources[shape.name] = source
        return shape

    def names(self) -> tuple[str, ...]:
        """The names of all objects, in order."""
        with self._lock:
            loaded = tuple(self._sources)
        return tuple(sorted({*loaded, *self._folder_files(), *library_names()}))

    def shape(self, name: str) -> Shape:
        """The shape of an object, which is built on first use. Raises `MeshError`."""
        with self._lock:
            source = self._sources.get(name)
        if source is None and (file := self._folder_files().get(name)) is not None:
            source = Source(file.resolve(), self._unit)
        if source is None and (file := library_file(name)) is not None:
            source = Source(file)
        if source is None:
            raise MeshError(f"object {name!r} is unknown; allowed are {', '.join(self.names())}")
        return self._built(source)

    def shapes(self) -> tuple[Shape, ...]:
        """The shapes that are built so far."""
        with self._lock:
            return tuple(self._shapes.values())

    def problems(self) -> dict[str, str]:
        """By file name, why the newest content of a file cannot be used; the shape from before stays in use."""
        with self._lock:
            return dict(self._problems)

    def changed(self) -> list[tuple[Shape, Shape]]:
        """Build the shapes of changed files again; returns the old and the new shape of each.

        A file counts as changed when it has stayed the same since the last call, so that nobody is still writing it.
        """
        with self._lock:
            sources = tuple(self._shapes)
        pairs = [(self._shapes[source], self._rebuilt(source)) for source in sources if self._has_settled(source)]
        return [(old, new) for old, new in pairs if new is not None and new.content_hash != old.content_hash]

    def _folder_files(self) -> dict[str, Path]:
        if self._folder is None:
            return {}
        try:
            paths = sorted(self._folder.iterdir())[:MAX_FOLDER_FILES]
        except OSError:
            return {}
        return {path.stem: path for path in paths if path.suffix.lower() in FORMATS}

    def _has_settled(self, source: Source) -> bool:
        """Whether a file differs from what was built and has not changed since the last look."""
        stamp = _stamp(source.path)
        before = self._unsettled.pop(source, None)
        if stamp is None or stamp == self._stamps.get(source):
            return False
        if stamp != before:
            self._unsettled[source] = stamp
        return stamp == before

    def _built(self, source: Source) -> Shape:
        with self._building:  # one shape at a time; a caller that needs no new shape does not wait for it
            with self._lock:
                shape = self._shapes.get(source)
            return shape or self._build(source)

    def _rebuilt(self, source: Source) -> Shape | None:
        try:
            with self._building:
                shape = self._build(source)
        except MeshError as error:
            _log.warning("a mesh file has changed, but its new content cannot be used: %s", error)
            with self._lock:
                self._problems[source.path.name] = str(error)
            return None
        _log.warning("%s has changed and is loaded again", source.path)
        return shape

    def _build(self, source: Source) -> Shape:
        self._stamps[source] = _stamp(source.path) or (0, 0)
        shape = self._build_shape(source.path, source.unit, source.scale)
        _ = shape.rays  # a tick must not be the first to ask for them
        with self._lock:
            self._shapes[source] = shape
            self._problems.pop(source.path.name, None)
        return shape


def _stamp(path: Path) -> tuple[int, int] | None:
    """Numbers that change with a file's content; None if there is no file."""
    try:
        stat = path.stat()
    except OSError:
        return None
    return stat.st_mtime_ns, stat.st_size
