"""Limits the connections of a WebSocket server whose opening handshake is not complete, and keeps its log short."""

import logging
from collections.abc import Callable
from functools import partial
from typing import Any, Final

from websockets.asyncio.server import ServerConnection
from websockets.protocol import State

MOST_HALF_OPEN: Final = 64
BACKLOG: Final = 32
"""Connections that the event loop accepts at once, before it can close any."""


class HalfOpen:
    """Makes the connections of one server. Belongs to the server's event loop."""

    def __init__(self, refuse: Callable[[], object] = lambda: None, most: int = MOST_HALF_OPEN) -> None:
        """At most `most` connections may be in the handshake; `refuse` is called for each that is closed for another.

        Those that have sent nothing are closed first, and of these the oldest.
        """
        self._refuse, self._most = refuse, most
        self._waiting: dict[_Connection, None] = {}

    @property
    def connection(self) -> Any:
        """Makes a `ServerConnection`: what `websockets.serve` takes as `create_connection`."""
        return partial(_Connection, self)

    def opened(self, connection: "_Connection") -> None:
        """Note a connection that was accepted, and close another one if there are too many."""
        self._waiting = {each: None for each in self._waiting if each.protocol.state is State.CONNECTING}
        if len(self._waiting) >= self._most:
            loser = next((each for each in self._waiting if each.is_silent), next(iter(self._waiting)))
            del self._waiting[loser]
            self._refuse()
            loser.transport.abort()
        self._waiting[connection] = None

    def closed(self, connection: "_Connection") -> None:
        """Forget a connection that has ended."""
        self._waiting.pop(connection, None)


class _Connection(ServerConnection):
    """A connection that reports when it begins and ends, and whether the client has sent anything."""

    def __init__(self, half_open: HalfOpen, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._half_open = half_open
        self.is_silent = True

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        self._half_open.opened(self)

    def data_received(self, data: bytes) -> None:
        self.is_silent = False
        super().data_received(data)

    def connection_lost(self, exc: Exception | None) -> None:
        self._half_open.closed(self)
        super().connection_lost(exc)


_FAULTS_OF_CLIENTS: Final = ("opening handshake failed", "unexpected internal error")
"""What `websockets` logs with a traceback when a client breaks off or breaks the protocol in an unexpected way."""


class _ShortLog(logging.Filter):
    """Turns the traceback of a client's fault into one line."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether the record is logged."""
        if record.exc_info is None or record.msg not in _FAULTS_OF_CLIENTS:
            return True
        error = record.exc_info[1]
        if isinstance(error, EOFError | ConnectionError) or isinstance(
            getattr(error, "__cause__", None), EOFError | ConnectionError
        ):
            return False  # the client has gone
        reason = str(error) or type(error).__name__
        record.msg, record.args, record.exc_info = "refused a connection: %s", (reason,), None
        record.levelno, record.levelname = logging.WARNING, "WARNING"
        return True


def handshake_log(name: str) -> logging.Logger:
    """The logger of a WebSocket server, which logs each failed handshake in one line."""
    log = logging.getLogger(name)
    if not any(isinstance(each, _ShortLog) for each in log.filters):
        log.addFilter(_ShortLog())
    return log
