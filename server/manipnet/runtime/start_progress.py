"""Says what a first start does while it compiles, from before the compiler itself is loaded until the end."""

import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

from platformdirs import user_cache_dir

from manipnet.common.shipped_folder import brings_kernels

STEP_S: Final = 1.0
LOG_S: Final = 5.0
TEXT: Final = "first start: code is compiled once, which takes 10 to 30 seconds"


class StartProgress:
    """Reports that a start compiles, until `end`: a terminal once a second in place, a log every few seconds."""

    def __init__(self, show: Callable[[str], None], log: Callable[[str], None], is_terminal: bool) -> None:
        """On a terminal, only `show` is called, elsewhere only `log`, so that nobody reads the same twice."""
        self._show, self._log, self._is_terminal = show, log, is_terminal
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="start-progress", daemon=True)

    def __enter__(self) -> "StartProgress":
        if is_first_start():
            self.begin()
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def begin(self) -> None:
        """Begin to report, unless it has begun."""
        if self._thread.ident is None:
            (self._show if self._is_terminal else self._log)(TEXT)
            self._thread.start()

    def end(self) -> None:
        """Report nothing any more."""
        self._ended.set()

    def _run(self) -> None:
        begin_s, logged_s = time.monotonic(), 0.0
        while not self._ended.wait(STEP_S):
            passed_s = time.monotonic() - begin_s
            if self._is_terminal:
                self._show(f"{TEXT}: {passed_s:.0f} s so far")
            elif passed_s - logged_s >= LOG_S:
                logged_s = passed_s
                self._log(f"still compiling after {passed_s:.0f} s")


def is_first_start() -> bool:
    """Whether no compiled code is on this machine yet. The compiler, which knows for certain, loads slowly."""
    if os.environ.get("NUMBA_CACHE_DIR") or brings_kernels(Path(__file__).parents[1]):
        return False
    root = Path(os.environ.get("MANIPNET_CACHE") or user_cache_dir("manipnet", appauthor=False)) / "kernels"
    return next(root.rglob("*.nbi"), None) is None
