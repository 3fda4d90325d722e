"""The shapes a server has or can get, by name, and the watch over their files."""

import logging
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from manipnet.actors.props import Prop
from manipnet.config.settings import ObjectConfig
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
    """Shapes of the rig, of the user's `folder` and of the library, each built once, on the thread that asks first.

    Of the same name, the rig's comes before the folder's, and that before the library's. Thread-safe.
    """

    def __init__(self, folder: Path | None = None, unit: str = "m") -> None:
        """`unit` is that of the folder's files."""
        self._folder, self._unit = folder, unit
        self._lock = threading.Lock()
        self._building = threading.Lock()
        self._sources: dict[str, Source] = {}
        self._shapes: dict[Source, Shape] = {}
        self._stamps: dict[Source, tuple[int, int]] = {}
        self._unsettled: dict[Source, tuple[int, int]] = {}
        self._problems: dict[str, str] = {}

    def load(self, config: ObjectConfig) -> Prop:
        """The prop of a rig's object. Raises `MeshError`."""
        source = Source(config.mesh.resolve(), config.unit, config.scale)
        shape = self._built(source)
        with self._lock:
            self._sources.setdefault(shape.name, source)
        return Prop(config.name, shape.name, shape)

    def add(self, file: Path, unit: str = "m") -> Shape:
        """A mesh file more to choose from, in the place of one of the same name. Raises `MeshError`."""
        source = Source(file.resolve(), unit)
        with self._lock:
            self._shapes.pop(source, None)
        shape = self._built(source)
        with self._lock:
            self._sources[shape.name] = source
        return shape

    def names(self) -> tuple[str, ...]:
        """What `shape` can be asked for."""
        with self._lock:
            own = tuple(self._sources)
        return tuple(sorted({*own, *self._folder_files(), *library_names()}))

    def shape(self, name: str) -> Shape:
        """A shape by name, built on first use. Raises `MeshError`."""
        with self._lock:
            source = self._sources.get(name)
        if source is None and (file := self._folder_files().get(name)) is not None:
            source = Source(file.resolve(), self._unit)
        if source is None and (file := library_file(name)) is not None:
            source = Source(file)
        if source is None:
            raise MeshError(f"no object {name!r}; there are {', '.join(self.names())}")
        return self._built(source)

    def shapes(self) -> tuple[Shape, ...]:
        """Those built so far."""
        with self._lock:
            return tuple(self._shapes.values())

    def problems(self) -> dict[str, str]:
        """Files that changed into something that is no object, and why; the shapes from before stay."""
        with self._lock:
            return dict(self._problems)

    def changed(self) -> list[tuple[Shape, Shape]]:
        """Build anew what was built from a file that has changed since, and has not within the last two looks; the
        old and the new shape of each."""
        with self._lock:
            sources = tuple(self._shapes)
        pairs = [(self._shapes[source], self._built_anew(source)) for source in sources if self._has_settled(source)]
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
        """Whether a file differs from what was built, and is as it was at the last look: nobody is writing it."""
        stamp = _stamp(source.path)
        before = self._unsettled.pop(source, None)
        if stamp is None or stamp == self._stamps.get(source):
            return False
        if stamp != before:
            self._unsettled[source] = stamp
        return stamp == before

    def _built(self, source: Source) -> Shape:
        with self._building:  # one at a time; whoever only wants what is there does not wait
            with self._lock:
                shape = self._shapes.get(source)
            return shape or self._build(source)

    def _built_anew(self, source: Source) -> Shape | None:
        try:
            with self._building:
                shape = self._build(source)
        except MeshError as error:
            _log.warning("a mesh file has changed, but is not used: %s", error)
            with self._lock:
                self._problems[source.path.name] = str(error)
            return None
        _log.warning("%s has changed and is loaded again", source.path)
        return shape

    def _build(self, source: Source) -> Shape:
        self._stamps[source] = _stamp(source.path) or (0, 0)
        shape = make_shape(source.path, source.unit, source.scale)
        _ = shape.rays  # a tick must not be the first to ask for them
        with self._lock:
            self._shapes[source] = shape
            self._problems.pop(source.path.name, None)
        return shape


def _stamp(path: Path) -> tuple[int, int] | None:
    """What changes with a file's content; None while there is none."""
    try:
        stat = path.stat()
    except OSError:
        return None
    return stat.st_mtime_ns, stat.st_size
