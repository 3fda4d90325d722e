"""Publishes hands on a bound PUB socket, in both encodings; `docs/protocol.md` describes the messages."""

import time

import zmq

from manipnet.net.curve_keys import ServerKeys
from manipnet.net.supervised import Pauses, ReceiverHealth
from manipnet.net.zmq_socket import BoundSocket
from manipnet.outputs.declaration import EncodedHands, HandsOutput
from manipnet.telemetry import Telemetry
from manipnet.wire import TOPIC_BIN, TOPIC_MSGPACK

MAX_SUBSCRIPTION_BYTES = 1024
"""Subscriptions, and the handshake of CURVE, are all that clients send."""


class ZmqPublisher(HandsOutput):
    """Publishes on `tcp://host:port`. Only a client that does not read loses messages, the newest ones."""

    def __init__(self, telemetry: Telemetry, host: str, port: int, keys: ServerKeys | None = None) -> None:
        """Bind the socket. Raises `ListenError` and `KeyFileError`. With `keys`, only listed clients may subscribe."""
        self._telemetry, self._host, self._keys = telemetry, host, keys
        self._bound = self._bind(port)
        self.address = self._bound.address
        self._health, self._pauses = ReceiverHealth("hands", telemetry), Pauses()
        self._pauses.opened()
        self._retry_s: float | None = None
        """When the socket, which has failed, is opened again."""

    def send(self, hands: EncodedHands) -> bool:
        """Publish one message under both topics; False while the socket has failed and is not open again yet."""
        if self._retry_s is not None and not self._reopened():
            return False
        try:
            self._bound.socket.send(TOPIC_MSGPACK + hands.msgpack)
            self._bound.socket.send(TOPIC_BIN + hands.binary)
        except zmq.ZMQError as error:
            self._bound.close()
            self._fail(error)
            return False
        return True

    def connected(self) -> int:
        """The number of clients that are connected. From any thread."""
        return self._bound.connected()

    def close(self) -> None:
        """Close the socket and free the port."""
        self._bound.close()

    def _bind(self, port: int) -> BoundSocket:
        return BoundSocket(zmq.PUB, self._host, port, self._telemetry, self._keys, MAX_SUBSCRIPTION_BYTES)

    def _fail(self, error: Exception) -> None:
        self._health.down(error)
        self._retry_s = time.monotonic() + self._pauses.next_s()

    def _reopened(self) -> bool:
        """Open the socket again on the same port, if it is time to; returns whether it is open."""
        if self._retry_s is None or time.monotonic() < self._retry_s:
            return False
        try:
            self._bound = self._bind(int(str(self.address).rpartition(":")[2]))
        except (OSError, ValueError) as error:
            self._fail(error)
            return False
        self._retry_s = None
        self._pauses.opened()
        self._health.up()
        return True
