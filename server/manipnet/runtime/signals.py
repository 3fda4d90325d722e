"""Runs work until the user or the operating system asks the program to stop."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

STOP_SIGNALS: Final = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGBREAK") if hasattr(signal, name)
)
"""Ctrl-C, a polite kill, and Ctrl-Break on Windows."""


@contextmanager
def stop_on_signals() -> Iterator[threading.Event]:
    """Yield an event that `STOP_SIGNALS` set instead of ending the program. Works in the main thread only."""
    stop = threading.Event()
    handlers = {number: signal.signal(number, lambda *_: stop.set()) for number in STOP_SIGNALS}
    try:
        yield stop
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
