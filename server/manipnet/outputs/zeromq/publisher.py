"""Publishes hands on a bound PUB socket, in both encodings; `docs/protocol.md` describes the messages."""

import math
import time

import zmq

from manipnet.net.curve_keys import ServerKeys
from manipnet.net.supervised import Pauses, ReceiverHealth
from manipnet.net.zmq_socket import BoundSocket
from manipnet.outputs.declaration import EncodedHands, HandsOutput
from manipnet.outputs.zeromq.subscriptions import Subscriptions
from manipnet.synthesis.hand.profile import HandProfile
from manipnet.telemetry import Telemetry
from manipnet.wire import TOPIC_BIN, TOPIC_MSGPACK, hand_topics

MAX_SUBSCRIPTION_BYTES = 1024
"""Subscriptions, and the handshake of CURVE, are all that clients send."""
READ_AT_ONCE = 256
"""Subscriptions that are read at one call."""
READ_EVERY_S = 0.04
"""How often they are read: asking the socket costs a tenth of encoding and sending a message."""


class ZmqPublisher(HandsOutput):
    """Publishes on `tcp://host:port`. Only a client that does not read loses messages, the newest ones."""

    def __init__(self, telemetry: Telemetry, host: str, port: int, keys: ServerKeys | None = None) -> None:
        """Bind the socket. Raises `ListenError` and `KeyFileError`. With `keys`, only listed clients may subscribe."""
        self._telemetry, self._host, self._keys = telemetry, host, keys
        self._bound = self._bind(port)
        self.address = self._bound.address
        self._health, self._pauses = ReceiverHealth("hands", telemetry), Pauses()
        self._pauses.opened()
        self._subscriptions, self._read_s = Subscriptions(), -math.inf
        self._retry_s: float | None = None
        """When the socket, which has failed, is opened again."""

    def send(self, hands: EncodedHands) -> bool:
        """Publish one message under the topics that have subscribers.

        False while the socket has failed and is not open again yet.
        """
        if self._retry_s is not None and not self._reopened():
            return False
        self._read_subscriptions()
        try:
            if self._subscriptions.include(TOPIC_MSGPACK):
                self._bound.socket.send(TOPIC_MSGPACK + hands.msgpack)
            if self._subscriptions.include(TOPIC_BIN):
                self._bound.socket.send(TOPIC_BIN + hands.binary)
        except zmq.ZMQError as error:
            self._bound.close()
            self._fail(error)
            return False
        return True

    def wants(self, avatar: str) -> bool:
        """Whether a client has subscribed to a topic of the avatar, or to a prefix of it."""
        self._read_subscriptions()
        return any(self._subscriptions.include(topic) for topic in hand_topics(avatar))

    def send_avatar(self, hands: EncodedHands, profile: HandProfile) -> bool:
        """Publish the hands of an avatar under those of its topics that have subscribers."""
        if self._retry_s is not None:
            return False
        try:
            msgpack_topic, binary_topic = hand_topics(profile.name)
            if self._subscriptions.include(msgpack_topic):
                self._bound.socket.send(msgpack_topic + hands.msgpack)
            if self._subscriptions.include(binary_topic):
                self._bound.socket.send(binary_topic + hands.binary)
        except zmq.ZMQError as error:
            self._bound.close()
            self._fail(error)
        return False

    def _read_subscriptions(self) -> None:
        """Note what clients have subscribed to, and whether any is connected, if that was not done just now."""
        now_s = time.monotonic()
        if self._retry_s is not None or now_s - self._read_s < READ_EVERY_S:
            return
        self._read_s = now_s
        self._subscriptions.count(self._bound.connected(), now_s)
        try:
            for _ in range(READ_AT_ONCE):
                if not int(self._bound.socket.getsockopt(zmq.EVENTS)) & zmq.POLLIN:
                    return  # reading would raise an exception, which costs ten times more
                frame = self._bound.socket.recv(zmq.NOBLOCK, copy=False)
                self._subscriptions.note(frame.bytes, _is_from_client(frame), now_s)
        except zmq.Again:
            pass
        except zmq.ZMQError as error:
            self._bound.close()
            self._fail(error)

    def connected(self) -> int:
        """The number of clients that are connected. From any thread."""
        return self._bound.connected()

    def close(self) -> None:
        """Close the socket and free the port."""
        self._bound.close()

    def _bind(self, port: int) -> BoundSocket:
        return BoundSocket(zmq.XPUB, self._host, port, self._telemetry, self._keys, MAX_SUBSCRIPTION_BYTES)

    def _fail(self, error: Exception) -> None:
        self._health.down(error)
        self._subscriptions.clear()
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


def _is_from_client(frame: zmq.Frame) -> bool:
    """Whether a client has sent it: what the socket itself reports has no address."""
    try:
        return bool(frame.get("Peer-Address"))
    except zmq.ZMQError:
        return False
