"""An HTTP server that answers every request of this machine's own programs with one text, on one thread."""

import contextlib
import logging
import selectors
import socket
import threading
import time
from collections.abc import Callable
from http import HTTPStatus
from typing import Final

from manipnet.net.addresses import is_own_name

MOST_CONNECTIONS: Final = 8
"""Beyond it, the oldest connection is closed."""
LONGEST_S: Final = 5.0
"""A connection that has not sent a whole request after this time is closed."""
MAX_REQUEST_BYTES: Final = 8192
SEND_S: Final = 1.0
FAULT_PAUSE_S: Final = 0.1
"""The pause after an error, which would otherwise come again at once."""
_SEND_BUFFER_BYTES: Final = 1 << 20
_log = logging.getLogger(__name__)


class SmallHttpServer:
    """Serves from its creation to `close`. `make` returns the text, which is `content_type`."""

    def __init__(self, host: str, port: int, content_type: str, make: Callable[[], bytes]) -> None:
        """Raises `OSError` if the address cannot be listened on."""
        self._content_type, self._make = content_type, make
        self._listener = socket.create_server((host, port), backlog=2 * MOST_CONNECTIONS)
        self._listener.setblocking(False)
        self.port: int = self._listener.getsockname()[1]
        self._wake, self._woken = socket.socketpair()
        self._requests: dict[socket.socket, tuple[float, bytearray]] = {}
        """When each connection was accepted, oldest first, and what it has sent so far."""
        self._selector = selectors.DefaultSelector()
        for each in (self._listener, self._woken):
            self._selector.register(each, selectors.EVENT_READ)
        self._thread = threading.Thread(target=self._run, name="http", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Close all connections and free the port."""
        self._wake.send(b"x")
        self._thread.join()
        for each in (*self._requests, self._listener, self._wake, self._woken, self._selector):
            each.close()

    def connected(self) -> int:
        """The number of connections. From any thread."""
        return len(self._requests)

    def _run(self) -> None:
        while True:
            for key, _ in self._selector.select(0.5 * LONGEST_S):
                if key.fileobj is self._woken:
                    return
                try:
                    if key.fileobj is self._listener:
                        self._accept()
                    elif isinstance(key.fileobj, socket.socket):
                        self._read(key.fileobj)
                except OSError as error:  # no descriptor is left for another connection, for example
                    _log.warning("a request over HTTP failed: %s", error)
                    time.sleep(FAULT_PAUSE_S)
                except Exception:
                    _log.exception("a request over HTTP failed")
            for connection, (since_s, _) in list(self._requests.items()):
                if time.monotonic() - since_s > LONGEST_S:
                    self._end(connection)

    def _accept(self) -> None:
        if len(self._requests) >= MOST_CONNECTIONS:
            self._end(next(iter(self._requests)))
        connection, _ = self._listener.accept()
        connection.setblocking(False)
        self._requests[connection] = time.monotonic(), bytearray()
        self._selector.register(connection, selectors.EVENT_READ)

    def _read(self, connection: socket.socket) -> None:
        if connection not in self._requests:
            return  # it was closed for another one
        _, request = self._requests[connection]
        try:
            part = connection.recv(4096)
        except OSError:
            part = b""
        request += part
        is_whole = b"\r\n\r\n" in request
        if is_whole:
            self._answer(connection, bytes(request))
        if is_whole or not part or len(request) > MAX_REQUEST_BYTES:
            self._end(connection)

    def _answer(self, connection: socket.socket, request: bytes) -> None:
        method, host = _method_and_host(request)
        status, content = HTTPStatus.OK, b""
        if method != "GET":
            status = HTTPStatus.METHOD_NOT_ALLOWED
        elif not is_own_name(host):
            status, content = HTTPStatus.FORBIDDEN, b"This is not for other web sites.\n"
        else:
            content = self._make()
        kind = self._content_type if status is HTTPStatus.OK else "text/plain"
        head = (
            f"HTTP/1.1 {status.value} {status.phrase}\r\nContent-Type: {kind}\r\n"
            f"Content-Length: {len(content)}\r\nX-Content-Type-Options: nosniff\r\nConnection: close\r\n\r\n"
        )
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)
        connection.settimeout(SEND_S)
        with contextlib.suppress(OSError):  # the client has gone
            connection.sendall(head.encode("ascii") + content)

    def _end(self, connection: socket.socket) -> None:
        del self._requests[connection]
        self._selector.unregister(connection)
        connection.close()


def _method_and_host(request: bytes) -> tuple[str, str]:
    """The method of a request, and its header `Host`; both are empty if it has none."""
    first, *lines = request.decode("latin-1").split("\r\n\r\n")[0].split("\r\n")
    headers = {name.strip().lower(): value.strip() for name, _, value in (line.partition(":") for line in lines)}
    return first.partition(" ")[0], headers.get("host", "")
