"""ZeroMQ sockets with limits, so that neither a client nor a sender can hurt a live session."""

import ipaddress
import socket
import threading

import zmq

from manipnet.common.options import Endpoint
from manipnet.net.access_control import AccessControl
from manipnet.net.curve_keys import ClientKeys, ServerKeys
from manipnet.net.errors import ListenError, cannot_listen
from manipnet.net.zap import secure_client
from manipnet.telemetry import Telemetry
from manipnet.wire.bodies import MAX_MESSAGE_BYTES

HIGH_WATER_MARK = 64
"""Messages that wait in a socket, half a second of hands. Beyond it, a client that does not read loses the newest."""
MAX_WIRE_BYTES = 4 * MAX_MESSAGE_BYTES
"""A message of up to this size is refused with a reason; a larger one costs its sender the connection."""
HEARTBEAT_MS = 1_000
HEARTBEAT_TIMEOUT_MS = 3_000


class BoundSocket:
    """A socket that is bound to an address of this machine, in a context of its own, and who may connect to it.

    With `keys`, connections are encrypted and only clients on the list of keys may connect.
    """

    def __init__(
        self,
        kind: zmq.SocketType,
        host: str,
        port: int,
        telemetry: Telemetry,
        keys: ServerKeys | None = None,
        max_bytes: int = MAX_WIRE_BYTES,
        high_water_mark: int = HIGH_WATER_MARK,
    ) -> None:
        """Bind the socket, where port 0 takes any free port. Raises `ListenError` and `KeyFileError`.

        A client that sends a message of more than `max_bytes` loses its connection. `high_water_mark` messages may wait
        for each client.
        """
        endpoint, ipv6 = zmq_endpoint(host, port)
        self.context = zmq.Context()
        self._ending = threading.Lock()
        self._access: AccessControl | None = None
        self.socket: zmq.Socket = self.context.socket(kind)
        _limit(self.socket, max_bytes, ipv6, high_water_mark)
        try:
            self._access = AccessControl(self.context, self.socket, telemetry, keys, failed=self._terminate)
            self.socket.bind(endpoint)
        except BaseException as error:
            self.close()
            if isinstance(error, zmq.ZMQError):
                raise cannot_listen(endpoint, zmq.strerror(error.errno or 0)) from None
            raise
        self.address: str = self.socket.getsockopt_string(zmq.LAST_ENDPOINT)

    def connected(self) -> int:
        """The number of connections. From any thread."""
        return 0 if self._access is None else len(self._access.connections)

    def delivered(self, frame: zmq.Frame) -> None:
        """A whole message was read, of which `frame` is one part."""
        if self._access is not None:
            self._access.connections.delivered(frame.get(zmq.SRCFD))

    def close(self) -> None:
        """Close the socket and free the port. Belongs to the thread that uses the socket."""
        self.socket.close()
        self.interrupt()

    def interrupt(self) -> None:
        """Raise `zmq.ContextTerminated` in the thread that waits at the socket, and wait until it closes the socket."""
        self._terminate()
        if self._access is not None:
            self._access.join()

    def _terminate(self) -> None:
        """End the context once. The access control does so when it fails, so that the socket is opened again."""
        if self._ending.acquire(blocking=False):
            self.context.term()


def connect(
    context: zmq.Context,
    kind: zmq.SocketType,
    endpoint: Endpoint,
    keys: ClientKeys | None = None,
    *,
    high_water_mark: int = HIGH_WATER_MARK,
    max_bytes: int = MAX_WIRE_BYTES,
) -> zmq.Socket:
    """A client's socket that connects to a socket of the server; `keys` are needed if the server asks for them.

    A `high_water_mark` of 0 and `max_bytes` of -1 mean no limit. Raises `zmq.ZMQError` for an impossible endpoint.
    """
    client: zmq.Socket = context.socket(kind)
    _limit(client, max_bytes, ipv6=":" in endpoint[0], high_water_mark=high_water_mark)
    try:
        if keys is not None:
            secure_client(client, keys)
        client.connect(tcp_address(endpoint))
    except BaseException:
        client.close()
        raise
    return client


def tcp_address(endpoint: Endpoint) -> str:
    """`tcp://HOST:PORT`, with an IPv6 address in brackets."""
    host, port = endpoint
    return f"tcp://[{host}]:{port}" if ":" in host else f"tcp://{host}:{port}"


def zmq_endpoint(host: str, port: int) -> tuple[str, bool]:
    """`tcp://…` for an address or the name of a machine, and whether it is IPv6. Raises `ListenError`."""
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        try:
            address = ipaddress.ip_address(socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][4][0])
        except (OSError, UnicodeError) as error:
            raise ListenError(f"cannot listen on host {host!r}: {error}; use an address of this machine") from None
    return tcp_address((str(address), port)), address.version == 6


def _limit(limited: zmq.Socket, max_bytes: int, ipv6: bool, high_water_mark: int = HIGH_WATER_MARK) -> None:
    """Replace ZeroMQ's defaults: messages of any size, no heartbeats, and a close that waits without end."""
    limited.setsockopt(zmq.LINGER, 0)
    limited.setsockopt(zmq.SNDHWM, high_water_mark)
    limited.setsockopt(zmq.RCVHWM, high_water_mark)
    limited.setsockopt(zmq.MAXMSGSIZE, max_bytes)
    limited.setsockopt(zmq.HEARTBEAT_IVL, HEARTBEAT_MS)
    limited.setsockopt(zmq.HEARTBEAT_TIMEOUT, HEARTBEAT_TIMEOUT_MS)
    limited.setsockopt(zmq.IPV6, int(ipv6))
