"""The connections of one bound ZeroMQ socket: how many there are, and what each sends that never becomes a message.

ZeroMQ bounds a frame, and how many messages wait; it bounds neither connections nor the frames of one message. Each
connection's own descriptor tells both. A descriptor may be closed and given to something else at any time, so none is
touched that is no connection to the socket's own port.
"""

import socket
import struct
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

MAX_UNDELIVERED_BYTES = 4 << 20
"""What may arrive from one connection before a message of it is complete; the largest message has a sixteenth."""
SMALL_TALK_BYTES = 1_024
"""What heartbeats and subscriptions may add between two looks."""
_TCP_INFO, _RECEIVED_AT, _INFO_BYTES = 11, 128, 136  # struct tcp_info: tcpi_bytes_received, Linux 4.1

Refuse = Callable[[str], None]
"""Told why a connection was cut off: `too_many` or `endless`."""


class Connections:
    """Who is connected, kept from the socket's events. One thread calls everything but `delivered` and `len`."""

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
        """A connection was accepted; one too many is cut off at once, which makes it False."""
        if len(self._received) >= self._most:
            self._cut(descriptor, "too_many")
            return False
        self._received[descriptor] = self._undelivered[descriptor] = 0
        return True

    def closed(self, descriptor: int) -> None:
        """A connection has ended."""
        self._received.pop(descriptor, None)
        self._undelivered.pop(descriptor, None)

    def delivered(self, descriptor: int) -> None:
        """A whole message of a connection was read. From any thread."""
        self._delivered.add(descriptor)

    def look(self) -> None:
        """Cut off who has sent much that is no message yet. Call a few times a second."""
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
            if connection is not None:  # a reset: what is still under way is worth no memory
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                connection.shutdown(socket.SHUT_RDWR)

    def _received_by(self, descriptor: int) -> int:
        """Bytes that ever came, or as many as before where the system does not tell."""
        if sys.platform == "linux":
            with self._borrowed(descriptor) as connection:
                if connection is not None:
                    info = connection.getsockopt(socket.IPPROTO_TCP, _TCP_INFO, _INFO_BYTES)
                    return int.from_bytes(info[_RECEIVED_AT:], sys.byteorder)
        return self._received[descriptor]

    @contextmanager
    def _borrowed(self, descriptor: int) -> Iterator[socket.socket | None]:
        """The connection as a socket that does not own it; None where it is gone, also while it is used."""
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
