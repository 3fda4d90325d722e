"""Lines for the person at the terminal, written by a thread of its own: a stopped terminal must not stop the ticks."""

import contextlib
import logging
import queue
import sys
import threading
import time
from typing import Final

from manipnet.telemetry import RateLimit

WAITING_LINES: Final = 200
LOG_FORMAT: Final = "%(asctime)s %(levelname)s %(name)s: %(message)s"


class Terminal(logging.Handler):
    """Writes `say` to standard output and log records to standard error; drops lines nobody reads."""

    def __init__(self) -> None:
        super().__init__()
        self.setFormatter(logging.Formatter(LOG_FORMAT))
        self.addFilter(RateLimit(time.monotonic))
        self._lines: queue.Queue[tuple[str, bool] | None] = queue.Queue(WAITING_LINES)
        self._thread = threading.Thread(target=self._write, name="terminal", daemon=True)
        self._thread.start()

    def say(self, line: str) -> None:
        """Show a line on standard output, soon."""
        self._put((line, False))

    def emit(self, record: logging.LogRecord) -> None:
        """Show a log record on standard error, soon."""
        self._put((self.format(record), True))

    def close(self) -> None:
        """Write what waits, unless nobody reads, and stop."""
        if self._thread.is_alive():
            self._put(None)
            self._thread.join(timeout=1.0)
        super().close()

    def _put(self, line: tuple[str, bool] | None) -> None:
        with contextlib.suppress(queue.Full):
            self._lines.put_nowait(line)

    def _write(self) -> None:
        while (line := self._lines.get()) is not None:
            text, is_log = line
            try:
                print(text, file=sys.stderr if is_log else sys.stdout, flush=True)
            except (OSError, ValueError):  # the pipe's reader is gone; the hands are not for it
                return
