"""Runs a function in a process of its own, with a pipe to it.

The child starts from a fresh interpreter, so that it shares no locks and no threads with the server. It ignores SIGINT:
a Ctrl-C in a terminal reaches every process there, but it is for the server, which then ends its children. If the
server is killed, the child reads the end of the pipe. It has a lower priority than the ticks, which matters on a
machine without a spare processor.
"""

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Final

from manipnet.runtime.memory import share_arenas

NICE: Final = 10
"""By how much the priority of a child is lower."""


class ChildProcess:
    """Runs `target(connection, *arguments)` until it returns. The target is a function of a module."""

    def __init__(self, name: str, target: Callable[..., None], *arguments: object) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        """Our end of the pipe."""
        self._error: Exception | None = None
        self._process = context.Process(target=_run, args=(target, theirs, arguments), name=name, daemon=True)
        starting = threading.Thread(target=self._start, name=f"start-{name}")
        starting.start()
        starting.join()
        theirs.close()
        if self._error is not None:
            raise self._error

    def _start(self) -> None:
        """Start the child on a thread of its own: on Linux, a child inherits the priority of the thread."""
        try:
            if sys.platform == "linux":
                os.setpriority(
                    os.PRIO_PROCESS, threading.get_native_id(), os.getpriority(os.PRIO_PROCESS, os.getpid()) + NICE
                )
            self._process.start()
        except Exception as error:
            self._error = error

    @property
    def exit_code(self) -> int | None:
        """Its exit status, or the negative number of the signal that ended it; None while it runs."""
        return self._process.exitcode

    def close(self, timeout_s: float | None = None) -> None:
        """Close the pipe and wait for the end of the child, at most `timeout_s`."""
        self.connection.close()
        self._process.join(timeout_s)

    def kill(self) -> None:
        """End the child at once if it still runs."""
        self._process.kill()
        self._process.join()


def _run(target: Callable[..., None], connection: Connection, arguments: tuple[object, ...]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    share_arenas()
    if hasattr(os, "nice") and sys.platform != "linux":
        os.nice(NICE)
    target(connection, *arguments)
