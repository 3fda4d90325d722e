"""Limits the connections of a bound ZeroMQ socket: their number, and what each sends without completing a message.

ZeroMQ limits the size of a frame and the number of messages that wait, but neither the number of connections nor the
number of frames in a message. The descriptor of each connection tells both. A descriptor may be closed and reused at
any time, so it is used only if it is a connection to the socket's own port.
"""

import socket
import struct
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

MAX_UNDELIVERED_BYTES = 4 << 20
"""Bytes that may arrive from one connection before a message is complete, 16 times the largest message."""
SMALL_TALK_BYTES = 1_024
"""Bytes that heartbeats and subscriptions may add between two checks."""
_TCP_INFO, _RECEIVED_AT, _INFO_BYTES = 11, 128, 136  # struct tcp_info: tcpi_bytes_received, Linux 4.1

Refuse = Callable[[str], None]
"""Called with the reason why a connection was closed: `too_many` or `endless`."""


class Connections:
    """The open connections, as the socket's events tell. One thread calls everything but `delivered` and `len`."""

    def __init__(self, most: int, refuse: Refuse) -> None:
        self._most, self._refuse = most, refuse
        self._port = 0
        self._received: dict[int, int] = {}
        self._undelivered: dict[int, int] = {}
        self._delivered: set[int] = set()

    def __len__(self) -> int:
        return len(self._received)

    def listening(self, port: int) -> None:
        """The socket is bound to `port`."""
        self._port = port

    def opened(self, descriptor: int) -> bool:
        """Add a connection that was accepted. Returns False if it is one too many, which is closed at once."""
        if len(self._received) >= self._most:
            self._cut(descriptor, "too_many")
            return False
        self._received[descriptor] = self._undelivered[descriptor] = 0
        return True

    def closed(self, descriptor: int) -> None:
        """Remove a connection that has ended."""
        self._received.pop(descriptor, None)
        self._undelivered.pop(descriptor, None)

    def delivered(self, descriptor: int) -> None:
        """Note that a whole message of a connection was read. From any thread."""
        self._delivered.add(descriptor)

    def look(self) -> None:
        """Close connections that have sent too much without completing a message. Call this a few times a second."""
        delivered, self._delivered = self._delivered, set()
        for descriptor, before in list(self._received.items()):
            received = self._received_by(descriptor)
            waits = self._undelivered[descriptor] + received - before - SMALL_TALK_BYTES
            self._received[descriptor] = received
            self._undelivered[descriptor] = 0 if descriptor in delivered else max(waits, 0)
            if self._undelivered[descriptor] > MAX_UNDELIVERED_BYTES:
                self._undelivered[descriptor] = 0
                self._cut(descriptor, "endless")

    def _cut(self, descriptor: int, reason: str) -> None:
        self._refuse(reason)
        with self._borrowed(descriptor) as connection:
            if connection is not None:  # a reset, so that what is still in transit takes no memory
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                connection.shutdown(socket.SHUT_RDWR)

    def _received_by(self, descriptor: int) -> int:
        """All bytes that have arrived, or as many as before if the system does not tell."""
        if sys.platform == "linux":
            with self._borrowed(descriptor) as connection:
                if connection is not None:
                    info = connection.getsockopt(socket.IPPROTO_TCP, _TCP_INFO, _INFO_BYTES)
                    return int.from_bytes(info[_RECEIVED_AT:], sys.byteorder)
        return self._received[descriptor]

    @contextmanager
    def _borrowed(self, descriptor: int) -> Iterator[socket.socket | None]:
        """The connection as a socket that does not own it, or None if it has ended. It may end while it is used."""
        connection = self._ours(descriptor)
        try:
            yield connection
        except OSError:
            pass
        finally:
            if connection is not None:
                connection.detach()

    def _ours(self, descriptor: int) -> socket.socket | None:
        try:
            connection = socket.socket(fileno=descriptor)
        except OSError:
            return None
        try:
            if connection.getsockname()[1] == self._port:
                return connection
        except (OSError, IndexError):
            pass
        connection.detach()
        return None
