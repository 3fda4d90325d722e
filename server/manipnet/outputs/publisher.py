"""Hands out, to every client and receiver that was asked for. Belongs to the tick thread; nothing here waits."""

import logging
import socket
from collections.abc import Callable

import zmq

from manipnet.config.settings import ConfigError, ServerConfig
from manipnet.net.access_control import AccessControl
from manipnet.net.curve_keys import ServerKeys
from manipnet.net.errors import ListenError
from manipnet.net.zmq_socket import bind, zmq_endpoint
from manipnet.outputs.livelink import LiveLinkJsonSender
from manipnet.outputs.vmc import VmcSender
from manipnet.outputs.websocket import WebSocketPublisher
from manipnet.telemetry import Telemetry
from manipnet.wire import TOPIC_BIN, TOPIC_MSGPACK, HandsMessage, encode_binary, encode_msgpack

SEND_HIGH_WATER_MARK = 64
"""Messages kept for a client that does not read, about half a second; then it loses the newest, the others nothing."""

_log = logging.getLogger(__name__)


class Publisher:
    """The outputs of one server: ZeroMQ and WebSocket always, VMC and Live Link where configured."""

    def __init__(
        self,
        config: ServerConfig,
        telemetry: Telemetry,
        keys: ServerKeys | None = None,
        record: Callable[[bytes], object] = lambda _: None,
    ) -> None:
        """Binds all sockets; raises `ListenError` or `ConfigError`, and then holds none.

        `record` is given each message as msgpack, and must return at once.

        With `keys` only clients on their list may subscribe, and browsers, which have none, stay on this machine.
        """
        self._telemetry, self._keys, self._record = telemetry, keys, record
        self._context = zmq.Context()
        self._pub: zmq.Socket | None = None
        self._web: WebSocketPublisher | None = None
        self._senders: list[tuple[str, VmcSender | LiveLinkJsonSender]] = []
        try:
            self._pub = self._bind_pub(config.host, config.port)
            self._web = _bind_web("127.0.0.1" if keys is not None else config.host, config.web_port, telemetry)
            if config.vmc is not None:
                self._senders.append(("vmc", VmcSender(*_resolve("--vmc", config.vmc))))
            if config.livelink is not None:
                self._senders.append(("livelink", LiveLinkJsonSender(*_resolve("--livelink", config.livelink))))
        except BaseException:
            self.close()
            raise
        self.addresses = {
            "hands": self._pub.getsockopt_string(zmq.LAST_ENDPOINT),
            "web": self._web.address,
        }
        """What it listens on, by what it carries."""

    def connected(self) -> dict[str, int]:
        """How many clients there are at present, by the socket. From any thread."""
        assert self._web is not None
        return {"hands": len(self._access.connections), "web": self._web.client_count}

    def publish(self, message: HandsMessage) -> None:
        """Send one message to everybody; raises `MessageError` for one that must not leave."""
        assert self._pub is not None
        assert self._web is not None
        binary = encode_binary(message)
        packed = encode_msgpack(message, checked=True)
        self._pub.send(TOPIC_MSGPACK + packed)
        self._pub.send(TOPIC_BIN + binary)
        self._record(packed)
        self._telemetry.count("messages_out", topic="msgpack")
        self._telemetry.count("messages_out", topic="bin")
        if self._web.client_count:
            self._web.publish(binary)
            self._telemetry.count("messages_out", topic="web")
        for topic, sender in self._senders:
            try:
                sender.send(message)
                self._telemetry.count("messages_out", topic=topic)
            except OSError as error:
                _log.warning("%s cannot be sent: %s", topic, error)

    def close(self) -> None:
        """Close every socket; harmless when called twice."""
        for _, sender in self._senders:
            sender.close()
        self._senders.clear()
        if self._web is not None:
            self._web.stop()
        if self._pub is not None:
            self._pub.close()
        self._context.term()

    def _bind_pub(self, host: str, port: int) -> zmq.Socket:
        endpoint, ipv6 = zmq_endpoint(host, port)
        pub = self._context.socket(zmq.PUB)
        pub.setsockopt(zmq.LINGER, 0)
        pub.setsockopt(zmq.SNDHWM, SEND_HIGH_WATER_MARK)
        pub.setsockopt(zmq.HEARTBEAT_IVL, 1_000)
        pub.setsockopt(zmq.HEARTBEAT_TIMEOUT, 3_000)
        pub.setsockopt(zmq.MAXMSGSIZE, 1024)  # subscriptions are all that comes in, and CURVE's handshake
        pub.setsockopt(zmq.IPV6, int(ipv6))
        try:
            self._access = AccessControl(self._context, pub, self._telemetry, self._keys)
            bind(pub, endpoint, "--port")
        except BaseException:
            pub.close()
            raise
        return pub


def _bind_web(host: str, port: int, telemetry: Telemetry) -> WebSocketPublisher:
    try:
        return WebSocketPublisher(host, port, telemetry)
    except OSError as error:
        raise ListenError(
            f"--web-port: cannot listen on {host}:{port}: {error.strerror or error}; "
            "is another program using it? --web-port 0 takes any free port"
        ) from None


def _resolve(option: str, endpoint: tuple[str, int]) -> tuple[str, int]:
    """The numeric address, looked up once: a name server must not be asked 60 times a second."""
    try:
        found = socket.getaddrinfo(*endpoint, family=socket.AF_INET, type=socket.SOCK_DGRAM)
        return str(found[0][4][0]), endpoint[1]
    except OSError as error:
        raise ConfigError(f"{option}: {endpoint[0]!r} is no address or known name ({error.strerror})") from None
