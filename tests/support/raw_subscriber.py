"""A subscriber that writes its bytes itself (https://rfc.zeromq.org/spec/23/), to send what no library would."""

import select
import socket
from urllib.parse import urlsplit

GREETING = b"\xff" + bytes(8) + b"\x7f\x03\x00" + b"NULL".ljust(20, b"\0") + bytes(32)
READY = b"\x05READY\x0bSocket-Type\x00\x00\x00\x03SUB"
COMMAND, MESSAGE = b"\x04", b"\x00"
SUBSCRIBE, UNSUBSCRIBE = b"\x01", b"\x00"
PATIENCE_S = 20.0


class RawSubscriber:
    """A connection to a publisher without keys; the constructor waits for the publisher's greeting and READY."""

    def __init__(self, address: str) -> None:
        place = urlsplit(address)
        self._socket = socket.create_connection((place.hostname, place.port), PATIENCE_S)
        self._socket.sendall(GREETING + COMMAND + bytes([len(READY)]) + READY)
        self.receive(64)
        self.receive(self.receive(2)[1])

    def send(self, what: bytes) -> None:
        """Send one short message, which a publisher takes for a subscription or for the end of one."""
        self._socket.sendall(MESSAGE + bytes([len(what)]) + what)

    def receive(self, count: int) -> bytes:
        """The next `count` bytes from the publisher."""
        data = b""
        while len(data) < count:
            more = self._socket.recv(count - len(data))
            assert more, "the publisher has closed the connection"
            data += more
        return data

    @property
    def has_received(self) -> bool:
        """Whether bytes from the publisher wait to be read."""
        return bool(select.select([self._socket], [], [], 0.0)[0])

    def close(self) -> None:
        self._socket.close()
