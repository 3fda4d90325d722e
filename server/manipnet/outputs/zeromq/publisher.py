"""Publishes hands on a bound PUB socket, in both encodings; `docs/protocol.md` describes the messages."""

import zmq

from manipnet.net.curve_keys import ServerKeys
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
        self._bound = BoundSocket(zmq.PUB, host, port, telemetry, keys, MAX_SUBSCRIPTION_BYTES)
        self.address = self._bound.address

    def send(self, hands: EncodedHands) -> bool:
        """Publish one message under both topics."""
        self._bound.socket.send(TOPIC_MSGPACK + hands.msgpack)
        self._bound.socket.send(TOPIC_BIN + hands.binary)
        return True

    def connected(self) -> int:
        """The number of clients that are connected. From any thread."""
        return self._bound.connected()

    def close(self) -> None:
        """Close the socket and free the port."""
        self._bound.close()
