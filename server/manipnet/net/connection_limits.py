"""Limits the connections of a bound ZeroMQ socket: their number, and what each sends without completing a message.

ZeroMQ limits the size of a frame and the number of messages that wait, but neither the number of connections nor the
number of frames in a message. The descriptor of each connection tells both. A descriptor may be closed and reused at
any time, so it is used only if it is a connection to the socket's own port.

Connections whose handshake is not complete have places of their own, so that strangers without keys cannot take those
of clients. If too many are in the handshake, those of the busiest addresses that have got least far are closed first.
"""

import socket
import struct
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

MAX_UNDELIVERED_BYTES = 4 << 20
"""Bytes that may arrive from one connection before a message is complete, 16 times the largest message."""
SMALL_TALK_BYTES = 1_024
"""Bytes that heartbeats and subscriptions may add between two checks."""
MOST_WAITING: Final = 64
"""Connections in the handshake that are kept; twice as many may come between two checks."""
MOST_OF_ADDRESS: Final = 16
"""An address with more connections in the handshake than this counts as a crowd, which loses its places first."""
FRESH_S: Final = 0.1
"""A connection as young as this is closed only if all others in the handshake are as young."""

_TCP_INFO, _ACKED_AT, _INFO_BYTES = 11, 120, 136
"""struct tcp_info, Linux 4.1: `tcpi_bytes_acked`, which `tcpi_bytes_received` follows."""
_GREETING_BYTES: Final = 64
_CURVE_BYTES: Final = _GREETING_BYTES + 170
"""What a CURVE server has sent before the handshake is complete: its greeting and WELCOME (RFC 26)."""

Refuse = Callable[[str], None]
"""Called with the reason why a connection was refused: `handshake`, `socket_type`, `too_many` or `endless`."""


@dataclass(slots=True)
class _Connection:
    """One connection: when it was accepted, from where, and how far it has got."""

    opened_s: float
    address: str
    received: int = 0
    progress: int = 0
    """Bytes that tell how far the handshake has got."""
    undelivered: int = 0
    admitted: bool = False
    cut: bool = False


class Connections:
    """The open connections, as the socket's events report. One thread calls everything but `delivered` and `len`."""

    def __init__(
        self, most: int, refuse: Refuse, curve: bool = False, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """`most` connections are admitted. `curve` says whether the handshake is CURVE's or NULL's."""
        self._most, self._refuse, self._clock = most, refuse, clock
        self._curve = curve
        self._port = 0
        self._open: dict[int, _Connection] = {}
        self._succeeded = self._denied = self._let_in = 0
        """Handshakes that succeeded, were denied, or got as far as a client that may connect, of which it is not known
        yet to which connections they belong."""
        self._delivered: set[int] = set()
        self._admitted = 0

    def __len__(self) -> int:
        """The number of admitted connections."""
        return self._admitted

    @property
    def unsettled(self) -> bool:
        """Whether `look` should be called soon."""
        return self._succeeded > 0

    def listening(self, port: int) -> None:
        """The socket is bound to `port`."""
        self._port = port

    def opened(self, descriptor: int) -> None:
        """Add a connection that was accepted."""
        self._open[descriptor] = _Connection(self._clock(), self._peer(descriptor))
        if len(self._waiting()) > 2 * MOST_WAITING:
            self.look()

    def succeeded(self) -> None:
        """Note that the handshake of one of the connections is complete."""
        self._succeeded += 1
        self._let_in = max(self._let_in - 1, 0)
        self.look()

    def let_in(self) -> None:
        """Note that a client that may connect is in the handshake. If it fails now, its socket has the wrong type."""
        self._let_in += 1

    def denied(self) -> None:
        """Note that one of the connections was refused for its key, which the caller has counted."""
        self._denied += 1

    def closed(self, descriptor: int) -> None:
        """Remove a connection that has ended. If its handshake was not complete, it counts as refused."""
        connection = self._open.pop(descriptor, None)
        if connection is None or connection.cut:
            return
        if connection.admitted:
            self._admitted -= 1
        elif self._succeeded > len(self._waiting()):  # no other connection can have succeeded
            self._succeeded -= 1
        elif self._denied:
            self._denied -= 1
        elif self._let_in:
            self._let_in -= 1
            self._refuse("socket_type")
        else:
            self._refuse("handshake")

    def delivered(self, descriptor: int) -> None:
        """Note that a whole message of a connection was read. From any thread."""
        self._delivered.add(descriptor)

    def look(self) -> None:
        """Admit connections, and close those that are too many or that send without end. Call this often."""
        delivered, self._delivered = self._delivered, set()
        for descriptor, connection in list(self._open.items()):
            if not connection.cut:
                self._measure(descriptor, connection, descriptor in delivered)
        self._admit()
        self._thin_out()

    def _measure(self, descriptor: int, connection: _Connection, delivered: bool) -> None:
        before = connection.received
        connection.received, acked = self._traffic(descriptor, connection)
        connection.progress = acked if self._curve else connection.received
        waits = connection.undelivered + connection.received - before - SMALL_TALK_BYTES
        connection.undelivered = 0 if delivered else max(waits, 0)
        if connection.undelivered > MAX_UNDELIVERED_BYTES:
            self._cut(descriptor, connection, "endless")

    def _admit(self) -> None:
        """Admit as many connections as have completed the handshake: those that have got farthest."""
        enough = (_CURVE_BYTES if self._curve else _GREETING_BYTES) + 1 if sys.platform == "linux" else 0
        waiting = [item for item in self._waiting() if item[1].progress >= enough]
        waiting.sort(key=lambda item: (-item[1].progress, -item[1].opened_s))
        for descriptor, connection in waiting[: self._succeeded]:
            self._succeeded -= 1
            if self._admitted >= self._most:
                self._cut(descriptor, connection, "too_many")
            else:
                connection.admitted = True
                self._admitted += 1
        self._succeeded = min(self._succeeded, len(self._waiting()))

    def _thin_out(self) -> None:
        """Close connections in the handshake that are too many."""
        waiting = self._waiting()
        if (excess := len(waiting) - MOST_WAITING) <= 0:
            return
        now_s, crowds = self._clock(), Counter(connection.address for _, connection in waiting)

        def worth(item: tuple[int, _Connection]) -> tuple[bool, bool, int, float]:
            _, each = item
            lonely, fresh = crowds[each.address] <= MOST_OF_ADDRESS, now_s - each.opened_s < FRESH_S
            return lonely, fresh, each.progress, each.opened_s

        for descriptor, connection in sorted(waiting, key=worth)[:excess]:
            self._cut(descriptor, connection, "too_many")

    def _waiting(self) -> list[tuple[int, _Connection]]:
        return [item for item in self._open.items() if not (item[1].admitted or item[1].cut)]

    def _cut(self, descriptor: int, connection: _Connection, reason: str) -> None:
        self._refuse(reason)
        self._admitted -= connection.admitted
        connection.admitted, connection.cut = False, True
        with self._borrowed(descriptor) as tcp:
            if tcp is not None:  # a reset, so that what is still in transit takes no memory
                tcp.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                tcp.shutdown(socket.SHUT_RDWR)

    def _peer(self, descriptor: int) -> str:
        with self._borrowed(descriptor) as tcp:
            return "" if tcp is None else tcp.getpeername()[0]
        return ""

    def _traffic(self, descriptor: int, connection: _Connection) -> tuple[int, int]:
        """All bytes that were received and acknowledged, or the number from before if the system does not report it."""
        if sys.platform == "linux":
            with self._borrowed(descriptor) as tcp:
                if tcp is not None:
                    info = tcp.getsockopt(socket.IPPROTO_TCP, _TCP_INFO, _INFO_BYTES)
                    acked, received = struct.unpack_from("=QQ", info, _ACKED_AT)
                    return received, acked
        return connection.received, connection.progress

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
