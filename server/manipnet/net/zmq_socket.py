"""ZeroMQ sockets that hold up beside a live session: addresses, limits, binding."""

import ipaddress
import socket

import zmq

from manipnet.net.errors import ListenError
from manipnet.wire.bodies import MAX_MESSAGE_BYTES

HIGH_WATER_MARK = 64
MAX_WIRE_BYTES = 4 * MAX_MESSAGE_BYTES
"""A message up to here is refused with a reason; a larger one costs its sender the connection."""
HEARTBEAT_MS = 1_000
HEARTBEAT_TIMEOUT_MS = 3_000


def zmq_endpoint(host: str, port: int) -> tuple[str, bool]:
    """`tcp://…` for a numeric address or a host name, and whether it is IPv6; raises `ListenError`."""
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        try:
            address = ipaddress.ip_address(socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][4][0])
        except (OSError, UnicodeError) as error:
            raise ListenError(f"cannot listen on host {host!r}: {error}; use an address of this machine") from None
    is_v6 = address.version == 6
    return (f"tcp://[{address}]:{port}" if is_v6 else f"tcp://{address}:{port}"), is_v6


def harden(receiver: zmq.Socket, ipv6: bool) -> None:
    """Replace the defaults that hurt a live server: unbounded messages, no heartbeats, endless linger."""
    receiver.setsockopt(zmq.LINGER, 0)
    receiver.setsockopt(zmq.RCVHWM, HIGH_WATER_MARK)
    receiver.setsockopt(zmq.MAXMSGSIZE, MAX_WIRE_BYTES)
    receiver.setsockopt(zmq.HEARTBEAT_IVL, HEARTBEAT_MS)
    receiver.setsockopt(zmq.HEARTBEAT_TIMEOUT, HEARTBEAT_TIMEOUT_MS)
    receiver.setsockopt(zmq.IPV6, int(ipv6))


def bind(sock: zmq.Socket, endpoint: str, option: str) -> None:
    """Bind, or close the socket and raise `ListenError` naming the endpoint and the option that moves it."""
    try:
        sock.bind(endpoint)
    except zmq.ZMQError as error:
        sock.close()
        raise ListenError(
            f"{option}: cannot listen on {endpoint}: {zmq.strerror(error.errno or 0)}; "
            f"is another server running? {option} 0 takes any free port"
        ) from None
