"""Reloads meshes whose files change while they are in use."""

import logging
import threading
from collections.abc import Callable
from typing import Final

from manipnet.runtime.object_catalog import ObjectCatalog
from manipnet.synthesis.objects.shape import Shape

POLL_S: Final = 0.5
_log = logging.getLogger(__name__)


class MeshWatch:
    """Checks the mesh files on a thread of its own, and lets `replace` swap the shapes of those that changed."""

    def __init__(self, catalog: ObjectCatalog, replace: Callable[[Shape, Shape], None]) -> None:
        """`replace(old, new)` swaps a shape wherever it is in use; if it raises, it is called again later."""
        self._catalog, self._replace = catalog, replace
        self._pending: list[tuple[Shape, Shape]] = []
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="mesh-watch", daemon=True)

    def start(self) -> None:
        """Begin to check."""
        self._thread.start()

    def stop(self) -> None:
        """Stop checking; returns when the thread has ended."""
        self._stopping.set()
        self._thread.join()

    def look(self) -> None:
        """Check all files once."""
        self._pending += self._catalog.changed()
        while self._pending:
            self._replace(*self._pending[0])
            self._pending.pop(0)

    def _run(self) -> None:
        while not self._stopping.wait(POLL_S):
            try:
                self.look()
            except Exception as error:  # the watch outlives whatever happens to a file
                _log.warning(
                    "mesh files could not be checked (%s: %s); the next check follows", type(error).__name__, error
                )
