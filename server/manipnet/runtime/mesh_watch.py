"""Meshes whose files change while they are used."""

import logging
import threading
from collections.abc import Callable
from typing import Final

from manipnet.runtime.object_catalog import ObjectCatalog
from manipnet.synthesis.objects.shape import Shape

POLL_S: Final = 0.5
_log = logging.getLogger(__name__)


class MeshWatch:
    """Looks for changed mesh files on a thread of its own, and has their shapes swapped wherever they are used."""

    def __init__(self, catalog: ObjectCatalog, swap: Callable[[Shape, Shape], None]) -> None:
        """`swap` puts the second shape in the place of the first; if it raises, it is asked again."""
        self._catalog, self._swap = catalog, swap
        self._pending: list[tuple[Shape, Shape]] = []
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="mesh-watch", daemon=True)

    def start(self) -> None:
        """Begin to look."""
        self._thread.start()

    def stop(self) -> None:
        """Stop looking; returns when it is done."""
        self._stopping.set()
        self._thread.join()

    def look(self) -> None:
        """Look once."""
        self._pending += self._catalog.changed()
        while self._pending:
            self._swap(*self._pending[0])
            self._pending.pop(0)

    def _run(self) -> None:
        while not self._stopping.wait(POLL_S):
            try:
                self.look()
            except Exception as error:  # the watch outlives whatever happens to a file
                _log.warning("the mesh watch stumbled, and goes on: %s: %s", type(error).__name__, error)
