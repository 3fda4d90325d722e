"""ZeroMQ on a plain TCP socket: ZMTP 3.0 and 3.1 with the NULL mechanism, as a subscriber or for one request.

It needs no library. The protocol is described at https://rfc.zeromq.org/spec/23/ and https://rfc.zeromq.org/spec/37/.
"""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Iterator

MORE, LONG, COMMAND = 1, 2, 4
GREETING = b"\xff" + bytes(8) + b"\x7f\x03\x01" + b"NULL".ljust(20, b"\0") + bytes(32)
SIGNATURE_BYTES = 11
"""The part of the greeting to send before reading: a server that dislikes the rest closes the connection without naming
the mechanism that it requires."""

RECEIVE_BYTES = 262_144
PING = b"\x04PING\x00\x00"  # no time to live: libzmq would disconnect us once frames flow and pings stop
PING_AFTER_S, DEAD_AFTER_S = 1.0, 3.0
SLICE_S = 0.25
"""How often a subscription without messages checks whether the other side is alive."""


class ZmtpError(OSError):
    """The other side does not speak ZeroMQ, refuses this client, or has closed the connection."""


def parse_address(address: str) -> tuple[str, int]:
    """Host and port of "tcp://host:port"; raises `ValueError`, whose text says what is allowed."""
    host, _, port = address.removeprefix("tcp://").rpartition(":")
    if not (address.startswith("tcp://") and host and port.isascii() and port.isdigit() and 0 < int(port) < 65536):
        raise ValueError(f"the address is {address!r}; allowed is tcp://HOST:PORT, as in tcp://127.0.0.1:5555")
    return host.strip("[]"), int(port)


class Connection:
    """One connection after its handshake. Not thread-safe, but any thread may call `interrupt`."""

    def __init__(self, host: str, port: int, socket_type: bytes, max_bytes: int, timeout_s: float = 2.0) -> None:
        """Connect as a `socket_type` ("SUB" or "REQ"); raises `OSError`. Frames above `max_bytes` are refused."""
        self._max_bytes = max_bytes
        self._buffer = bytearray()
        self._heard_s = time.monotonic()
        self._socket = socket.create_connection((host, port), timeout_s)
        try:
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._minor_version = self._handshake(socket_type, timeout_s)
        except BaseException:
            self._socket.close()
            raise

    def interrupt(self) -> None:
        """Make a waiting `receive` raise `OSError`."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()

    def send(self, flags: int, body: bytes) -> None:
        """Send one frame."""
        if len(body) < 256:
            self._socket.sendall(bytes([flags, len(body)]) + body)
        else:
            self._socket.sendall(bytes([flags | LONG]) + len(body).to_bytes(8, "big") + body)

    def receive(self, timeout_s: float) -> None:
        """Wait for more bytes; raises `TimeoutError` when none arrive in time, `OSError` when the connection ends."""
        self._socket.settimeout(max(timeout_s, 1e-3))
        data = self._socket.recv(RECEIVE_BYTES)
        if not data:
            raise ZmtpError("the server closed the connection")
        self._heard_s = time.monotonic()
        self._buffer += data

    def frames(self) -> Iterator[tuple[bytes, bool]]:
        """The frames received so far and not yet returned: each body, and whether its message has more frames."""
        while frame := self._next_frame():
            flags, body = frame
            if not flags & COMMAND:
                yield body, bool(flags & MORE)
            elif body.startswith(b"\x04PING"):
                self.send(COMMAND, b"\x04PONG" + body[7:23])

    def _handshake(self, socket_type: bytes, timeout_s: float) -> int:
        """Exchange greetings and READY; returns the minor version of the protocol that the other side speaks."""
        self._socket.sendall(GREETING[:SIGNATURE_BYTES])
        while len(self._buffer) < len(GREETING):
            self.receive(timeout_s)
        greeting = bytes(self._buffer[: len(GREETING)])
        del self._buffer[: len(GREETING)]
        if greeting[0] != 0xFF or not greeting[9] & 1 or greeting[10] < 3:
            raise ZmtpError("the other side does not speak ZMTP 3")
        mechanism = greeting[12:32].rstrip(b"\0")
        if mechanism != b"NULL":
            name = mechanism.decode("ascii", "replace")
            raise ZmtpError(f"the server requires {name}; pass `keys` to this client, or use a tunnel")
        self._socket.sendall(GREETING[SIGNATURE_BYTES:])
        self.send(COMMAND, b"\x05READY\x0bSocket-Type" + len(socket_type).to_bytes(4, "big") + socket_type)
        while not (ready := self._next_frame()):
            self.receive(timeout_s)
        if not (ready[0] & COMMAND and ready[1].startswith(b"\x05READY")):
            raise ZmtpError("the server refused the connection")
        return greeting[11]

    def _next_frame(self) -> tuple[int, bytes] | None:
        buffer = self._buffer
        head = 9 if buffer and buffer[0] & LONG else 2
        if len(buffer) < head:
            return None
        flags, size = buffer[0], int.from_bytes(buffer[1:head], "big")
        if size > self._max_bytes:
            raise ZmtpError(f"the server sent a frame of {size} bytes; at most {self._max_bytes} are allowed")
        if len(buffer) < head + size:
            return None
        body = bytes(buffer[head : head + size])
        del buffer[: head + size]
        return flags, body


class Subscription(Connection):
    """A connection that is subscribed to one topic."""

    def __init__(self, host: str, port: int, topic: bytes, max_bytes: int) -> None:
        """Connect and subscribe; raises `OSError`. Frames above `max_bytes` are refused."""
        super().__init__(host, port, b"SUB", max_bytes)
        self._pinged_s = self._heard_s
        self._is_inside_message = False
        if self._minor_version >= 1:
            self.send(COMMAND, b"\x09SUBSCRIBE" + topic)
        else:
            self.send(0, b"\x01" + topic)

    def batches(self) -> Iterator[list[bytes]]:
        """Yield all messages received so far, oldest first, again and again; an empty list while none arrive.

        Raises `OSError` when the connection is lost or when the other side does not even answer a ping.
        """
        while True:
            yield self._messages()
            try:
                self.receive(SLICE_S)
            except TimeoutError:
                self._check_alive()

    def _messages(self) -> list[bytes]:
        """The complete messages of one frame, as all of ours are; longer messages are skipped."""
        found = []
        for body, has_more in self.frames():
            if not (has_more or self._is_inside_message):
                found.append(body)
            self._is_inside_message = has_more
        return found

    def _check_alive(self) -> None:
        now_s = time.monotonic()
        if now_s - self._heard_s > DEAD_AFTER_S:
            raise ZmtpError(f"nothing has arrived for {DEAD_AFTER_S:.0f} s")
        if now_s - self._heard_s > PING_AFTER_S and now_s - self._pinged_s > PING_AFTER_S:
            self._pinged_s = now_s
            self.send(COMMAND, PING)


def request(host: str, port: int, body: bytes, max_bytes: int, timeout_s: float) -> bytes:
    """Send one request to a REP socket and return the reply; raises `OSError`, in particular `TimeoutError`."""
    give_up_s = time.monotonic() + timeout_s
    with contextlib.closing(Connection(host, port, b"REQ", max_bytes, timeout_s)) as connection:
        connection.send(MORE, b"")  # the empty frame that separates a REQ socket's address from its message
        connection.send(0, body)
        while True:
            for reply, has_more in connection.frames():
                if not has_more:
                    return reply
            connection.receive(give_up_s - time.monotonic())
