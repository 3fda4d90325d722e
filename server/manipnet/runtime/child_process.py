"""A function in a process of its own, with a pipe to it.

The child starts from a fresh interpreter, so that it shares no locks and no threads with the server. It ignores SIGINT:
a Ctrl-C in a terminal reaches every process there, but it is for the server, which then ends its children. If the
server is killed, the child reads the end of the pipe.
"""

import multiprocessing
import signal
from collections.abc import Callable
from multiprocessing.connection import Connection


class ChildProcess:
    """Runs `target(connection, *arguments)` until it returns. The target is a function of a module."""

    def __init__(self, name: str, target: Callable[..., None], *arguments: object) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        """Our end of the pipe."""
        self._process = context.Process(target=_run, args=(target, theirs, arguments), name=name, daemon=True)
        self._process.start()
        theirs.close()

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
    target(connection, *arguments)
