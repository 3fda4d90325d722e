"""Threads that receive: an error costs one message, or a pause until the socket is open again, but not the thread."""

import logging
import threading
import time
from collections.abc import Callable
from typing import Any, Final

from manipnet.common.log_limits import LogThrottle
from manipnet.telemetry import Telemetry

FIRST_PAUSE_S: Final = 0.1
LONGEST_PAUSE_S: Final = 5.0
"""The pause before a socket is opened again doubles each time, from the first to the longest."""
LASTED_S: Final = 10.0
"""A socket that has worked for this long begins with the first pause again."""
LOG_PERIOD_S: Final = 5.0

_log = logging.getLogger(__name__)


class ReceiverHealth:
    """Whether a socket listens, and what has gone wrong with it. Thread-safe."""

    def __init__(self, name: str, telemetry: Telemetry) -> None:
        """`name` is the label of the counter `receiver_restarts`, and the key in the request `status`."""
        self._name, self._telemetry = name, telemetry
        self._restarts, self._error, self._is_down = 0, "", False
        self._log_throttle = LogThrottle(LOG_PERIOD_S)
        telemetry.declare("receiver_restarts", name)
        telemetry.add_receiver(name, self.report)

    def report(self) -> dict[str, Any]:
        """`state`, which is "listening" or "down", the number of `restarts`, and the newest `error` or None."""
        state = "down" if self._is_down else "listening"
        return {"state": state, "restarts": self._restarts, "error": self._error or None}

    def down(self, error: Exception) -> None:
        """The socket has failed, or cannot be opened again."""
        self._error, self._is_down = f"{type(error).__name__}: {error}", True
        if self._log_throttle.admit("down") is not None:
            _log.error("%s: the socket has failed (%s); it will be opened again", self._name, self._error)

    def up(self) -> None:
        """The socket has been opened again."""
        self._is_down = False
        self._restarts += 1
        self._telemetry.count("receiver_restarts", source=self._name)
        if self._log_throttle.admit("up") is not None:
            _log.warning("%s: the socket is open again", self._name)

    def message_failed(self) -> None:
        """Count and log the exception that is being handled, which has cost one message."""
        self._telemetry.count("frames_dropped", reason="internal")
        held_back = self._log_throttle.admit("message")
        if held_back is not None:
            _log.exception("%s: a message could not be handled (%d more since the last line)", self._name, held_back)


class Pauses:
    """The growing pauses between attempts to open a socket."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._next_s, self._opened_s = FIRST_PAUSE_S, float("-inf")

    def opened(self) -> None:
        """The socket is open."""
        self._opened_s = self._clock()

    def next_s(self) -> float:
        """How long to wait before the next attempt."""
        if self._clock() - self._opened_s > LASTED_S and self._opened_s > float("-inf"):
            self._next_s, self._opened_s = FIRST_PAUSE_S, float("-inf")
        pause_s, self._next_s = self._next_s, min(2.0 * self._next_s, LONGEST_PAUSE_S)
        return pause_s


class SupervisedThread:
    """Calls `serve`, and `reopen` after each of its errors, until it is stopped."""

    def __init__(
        self, name: str, health: ReceiverHealth, serve: Callable[[], None], reopen: Callable[[], object]
    ) -> None:
        """`serve` returns when `stopping` is set and the owner has interrupted it; it raises when its socket fails.

        `reopen` closes the socket and opens it again on the same address, or raises.
        """
        self.stopping = threading.Event()
        self._health, self._serve, self._reopen = health, serve, reopen
        self._pauses = Pauses()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Begin."""
        self._pauses.opened()
        self._thread.start()

    def join(self) -> None:
        """Wait for the end of the thread. Call this once `stopping` is set."""
        self._thread.join()

    def is_alive(self) -> bool:
        """Whether the thread runs."""
        return self._thread.is_alive()

    def _run(self) -> None:
        while not self.stopping.is_set():
            try:
                self._serve()
                error: Exception = RuntimeError("the receiver has ended without a reason")
            except Exception as raised:
                error = raised
            while not self.stopping.is_set():
                self._health.down(error)
                if self.stopping.wait(self._pauses.next_s()):
                    return
                try:
                    self._reopen()
                except Exception as raised:
                    error = raised
                else:
                    self._pauses.opened()
                    self._health.up()
                    break
