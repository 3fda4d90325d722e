"""A ZeroMQ subscriber on a plain TCP socket: ZMTP 3, NULL mechanism, one topic. Needs no library."""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Iterator

MORE, LONG, COMMAND = 1, 2, 4
GREETING = b"\xff" + bytes(8) + b"\x7f\x03\x01" + b"NULL".ljust(20, b"\0") + bytes(32)
SIGNATURE_BYTES = 11
"""What to send before reading: a server that dislikes the rest hangs up without saying which mechanism it wants."""

RECEIVE_BYTES = 262_144
PING = b"\x04PING\x00\x00"  # no time to live: libzmq would cut us off once frames flow and pings stop
PING_AFTER_S, DEAD_AFTER_S = 1.0, 3.0


class ZmtpError(OSError):
    """The other side is no ZeroMQ publisher that speaks to us, or has gone."""


def parse_address(address: str) -> tuple[str, int]:
    """Host and port of "tcp://host:port"; raises `ValueError` with what is allowed."""
    host, _, port = address.removeprefix("tcp://").rpartition(":")
    if not (address.startswith("tcp://") and host and port.isascii() and port.isdigit() and 0 < int(port) < 65536):
        raise ValueError(f"address is {address!r}; allowed is tcp://HOST:PORT, as in tcp://127.0.0.1:5555")
    return host.strip("[]"), int(port)


class Subscription:
    """One connection, subscribed to one topic. Not thread-safe, but `interrupt` may come from anywhere."""

    def __init__(self, host: str, port: int, topic: bytes, max_bytes: int, timeout_s: float = 2.0):
        self._max_bytes = max_bytes
        self._buffer = bytearray()
        self._in_parts = False
        self._heard = self._pinged = time.monotonic()
        self._socket = socket.create_connection((host, port), timeout_s)
        try:
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._handshake(topic)
            self._socket.settimeout(0.25)
        except BaseException:
            self._socket.close()
            raise

    def interrupt(self) -> None:
        """End a waiting `batches` with `OSError`."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()

    def batches(self) -> Iterator[list[bytes]]:
        """All frames that have arrived by now, oldest first, again and again; empty lists while it is silent.

        Raises `OSError` when the connection is lost or the other side is silent even to a ping.
        """
        while True:
            yield self._messages()
            try:
                self._receive()
            except TimeoutError:
                self._check_alive()

    def _check_alive(self) -> None:
        now = time.monotonic()
        if now - self._heard > DEAD_AFTER_S:
            raise ZmtpError(f"nothing heard for {DEAD_AFTER_S:.0f} s")
        if now - self._heard > PING_AFTER_S and now - self._pinged > PING_AFTER_S:
            self._pinged = now
            self._send(COMMAND, PING)

    def _handshake(self, topic: bytes) -> None:
        self._socket.sendall(GREETING[:SIGNATURE_BYTES])
        greeting = self._read(64)
        if greeting[0] != 0xFF or not greeting[9] & 1 or greeting[10] < 3:
            raise ZmtpError("the other side does not speak ZMTP 3")
        if greeting[12:32].rstrip(b"\0") != b"NULL":
            mechanism = greeting[12:32].rstrip(b"\0").decode("ascii", "replace")
            raise ZmtpError(f"the server asks for {mechanism}; give this client `keys`, or use a tunnel")
        self._socket.sendall(GREETING[SIGNATURE_BYTES:])
        self._send(COMMAND, b"\x05READY\x0bSocket-Type\x00\x00\x00\x03SUB")
        while not (ready := self._next_frame()):
            self._receive()
        if not (ready[0] & COMMAND and ready[1].startswith(b"\x05READY")):
            raise ZmtpError("the server refused the connection")
        if greeting[11] >= 1:
            self._send(COMMAND, b"\x09SUBSCRIBE" + topic)
        else:
            self._send(0, b"\x01" + topic)

    def _messages(self) -> list[bytes]:
        """Whole messages in the buffer. Ours have one frame; the parts of longer ones are left out."""
        found = []
        while frame := self._next_frame():
            flags, body = frame
            if flags & COMMAND:
                self._answer(body)
                continue
            if not (flags & MORE or self._in_parts):
                found.append(body)
            self._in_parts = bool(flags & MORE)
        return found

    def _answer(self, command: bytes) -> None:
        if command.startswith(b"\x04PING"):
            self._send(COMMAND, b"\x04PONG" + command[7:23])

    def _next_frame(self) -> tuple[int, bytes] | None:
        buffer = self._buffer
        head = 9 if buffer and buffer[0] & LONG else 2
        if len(buffer) < head:
            return None
        flags, size = buffer[0], int.from_bytes(buffer[1:head], "big")
        if size > self._max_bytes:
            raise ZmtpError(f"a frame of {size} bytes; at most {self._max_bytes} are allowed")
        if len(buffer) < head + size:
            return None
        body = bytes(buffer[head : head + size])
        del buffer[: head + size]
        return flags, body

    def _read(self, count: int) -> bytes:
        while len(self._buffer) < count:
            self._receive()
        data = bytes(self._buffer[:count])
        del self._buffer[:count]
        return data

    def _receive(self) -> None:
        data = self._socket.recv(RECEIVE_BYTES)
        if not data:
            raise ZmtpError("the server closed the connection")
        self._heard = time.monotonic()
        self._buffer += data

    def _send(self, flags: int, body: bytes) -> None:
        self._socket.sendall(bytes([flags, len(body)]) + body)
