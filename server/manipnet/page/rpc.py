"""The page's end of the pipe to the server: frames and shapes arrive, requests are sent."""

import contextlib
import itertools
import logging
import threading
from collections.abc import Iterable, Iterator
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from multiprocessing.connection import Connection
from typing import Any, Final

import msgpack

from manipnet.page.serialization import pack, unpack

ANSWER_S: Final = 60.0
"""The shape of a large mesh takes a while to build."""


class RefusedError(RuntimeError):
    """The server refused a request; the text says why."""


class RpcClient:
    """`incoming` on one thread; `ask` and `watch` on any other."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._sending = threading.Lock()
        self._numbers = itertools.count()
        self._asked: dict[int, Future] = {}

    def incoming(self) -> Iterator[tuple[str, Any]]:
        """Everything but answers, as it arrives; ends when the server ends."""
        with contextlib.suppress(EOFError, OSError):
            while True:
                what, content = unpack(self._connection.recv_bytes())
                if what == "answer":
                    number, answer = content
                    self._asked.pop(number).set_result(msgpack.unpackb(answer))
                else:
                    yield what, content

    def ask(self, **request: Any) -> dict[str, Any]:
        """Send one control request of docs/protocol.md and return its answer. Raises `RefusedError`."""
        number, answer = next(self._numbers), Future()
        self._asked[number] = answer
        self._send("ask", (number, msgpack.packb(request)))
        try:
            reply = answer.result(ANSWER_S)
        except FutureTimeoutError:
            raise RefusedError(f"the server did not answer within {ANSWER_S:.0f} s") from None
        if "error" in reply:
            raise RefusedError(reply["error"])
        return reply

    def watch(self, watched: bool) -> None:
        """Report whether a browser is open."""
        self._send("watched", watched)

    def show_hands(self, avatars: Iterable[str]) -> None:
        """Ask for the hands of these avatars, and of no others."""
        self._send("hands", tuple(avatars))

    def log(self, level: int, text: str) -> None:
        """Send a line to the server's log."""
        self._send("log", (level, text))

    def _send(self, what: str, content: Any) -> None:
        with self._sending, contextlib.suppress(OSError):  # the server has ended, which `incoming` notices
            self._connection.send_bytes(pack(what, content))


class RpcLog(logging.Handler):
    """Forwards the log of this process to the server's."""

    def __init__(self, link: RpcClient) -> None:
        super().__init__(logging.WARNING)
        self._link = link

    def emit(self, record: logging.LogRecord) -> None:
        """Send one record."""
        self._link.log(record.levelno, self.format(record))
