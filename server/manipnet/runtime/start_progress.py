"""Says what a first start does while it compiles, from before the compiler itself is loaded until the end."""

import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from platformdirs import user_cache_dir

USUAL_S: Final = 15
"""How long compiling takes on a small machine, as the text says."""
STEP_S: Final = 1.0
LOG_S: Final = 5.0
TEXT: Final = f"first start: compiling, once, for about {USUAL_S} s"


class StartProgress:
    """Reports once a second with `show`, and every few seconds with `log`, that a start compiles; until `end`."""

    def __init__(self, show: Callable[[str], None], log: Callable[[str], None]) -> None:
        self._show, self._log = show, log
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="start-progress", daemon=True)

    def __enter__(self) -> "StartProgress":
        if is_first_start():
            self._log(TEXT)
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def end(self) -> None:
        """Report nothing any more."""
        self._ended.set()

    def _run(self) -> None:
        begin_s, logged_s = time.monotonic(), 0.0
        while not self._ended.wait(STEP_S):
            passed_s = time.monotonic() - begin_s
            self._show(f"{TEXT}: {passed_s:.0f} s so far")
            if passed_s - logged_s >= LOG_S:
                logged_s = passed_s
                self._log(f"still compiling after {passed_s:.0f} s")


def is_first_start() -> bool:
    """Whether no compiled code is kept on this machine yet. The compiler, which knows for certain, loads slowly."""
    if os.environ.get("NUMBA_CACHE_DIR"):
        return False
    root = Path(os.environ.get("MANIPNET_CACHE") or user_cache_dir("manipnet", appauthor=False)) / "kernels"
    return next(root.rglob("*.nbi"), None) is None
