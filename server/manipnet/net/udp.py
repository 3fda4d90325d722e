"""UDP sockets, and a thread that reads one; used by OSC and NatNet."""

import contextlib
import os
import socket
import struct
import sys
import time
from collections.abc import Callable

from manipnet.common.options import ConfigError
from manipnet.net.errors import ListenError, cannot_listen
from manipnet.net.supervised import ReceiverHealth, SupervisedThread

Address = tuple[str, int]
Receive = Callable[[bytes, Address, float], None]
"""Called with a datagram, its sender, and the time when it was read (`time.monotonic`)."""
Idle = Callable[[float], float]
"""Called after each datagram, and when none has arrived, to do what is due. Returns when to be called again, in
seconds."""

RECEIVE_BUFFER_BYTES = 4 << 20
DROPS_PERIOD_S = 0.2
_SO_MEMINFO, _MEMINFO_WORDS, _MEMINFO_DROPS = 55, 9, 8


class UdpThread:
    """Reads the datagrams of one socket and passes them to `receive`, until it is stopped.

    A blocking receive with a timeout in the kernel costs one call per datagram, and needs no second descriptor to wake
    it. `lost` is called with the number of datagrams that the kernel dropped (on Linux only). A socket that fails is
    replaced by the one that `reopen` makes.
    """

    def __init__(
        self,
        udp: socket.socket,
        reopen: Callable[[], socket.socket],
        receive: Receive,
        idle: Idle,
        lost: Callable[[int], None],
        health: ReceiverHealth,
    ) -> None:
        self.socket = udp
        self._open, self._receive, self._idle, self._lost, self._health = reopen, receive, idle, lost, health
        self._timeout_s = 0.0
        self._drops = 0
        self._thread = SupervisedThread(f"udp-{udp.getsockname()[1]}", health, self._run, self._reopen)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """Stop the thread and close the socket. Returns within the longest idle time."""
        self._thread.stopping.set()
        self._thread.join()
        self._close()

    def _run(self) -> None:
        """Read until `stopping` is set. Raises `OSError` when the socket has failed."""
        buffer = bytearray(65_536)
        view = memoryview(buffer)
        look_s = time.monotonic()
        self._set_timeout(self._next_s(look_s))
        while not self._thread.stopping.is_set():
            try:
                size, source = self.socket.recvfrom_into(buffer)
                now_s = time.monotonic()
            except (BlockingIOError, TimeoutError, InterruptedError, ConnectionResetError):
                now_s = time.monotonic()  # nothing arrived, or (on Windows) an earlier reply was refused
            else:
                try:
                    self._receive(bytes(view[:size]), source[:2], now_s)
                except Exception:
                    self._health.message_failed()
            self._set_timeout(self._next_s(now_s))
            if now_s - look_s > DROPS_PERIOD_S:
                look_s = now_s
                self._count_drops()

    def _next_s(self, now_s: float) -> float:
        try:
            return self._idle(now_s)
        except Exception:
            self._health.message_failed()
            return DROPS_PERIOD_S

    def _reopen(self) -> None:
        self._close()
        self.socket, self._timeout_s, self._drops = self._open(), 0.0, 0

    def _close(self) -> None:
        with contextlib.suppress(OSError):  # a socket that has failed may be closed already
            self.socket.close()

    def _set_timeout(self, seconds: float) -> None:
        seconds = min(max(seconds, 0.001), 0.25)
        if seconds == self._timeout_s:
            return
        self._timeout_s = seconds
        milliseconds = int(seconds * 1_000)
        if sys.platform == "win32":
            value = struct.pack("@i", milliseconds)
        else:
            value = struct.pack("@ll", milliseconds // 1_000, milliseconds % 1_000 * 1_000)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, value)

    def _count_drops(self) -> None:
        drops = kernel_drops(self.socket)
        if drops > self._drops:
            self._lost(drops - self._drops)
            self._drops = drops


def bind_udp(host: str, port: int) -> socket.socket:
    """A UDP socket with a large receive buffer on `host:port`; port 0 takes any free port. Raises `ListenError`."""
    udp: socket.socket | None = None
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        udp = _socket(family)
        udp.bind(address)
    except (OSError, UnicodeError) as error:
        if udp is not None:
            udp.close()
        raise cannot_listen(f"udp://{host}:{port}", _reason(error)) from None
    return udp


def resolve(host: str, port: int) -> Address:
    """The IPv4 address of `host`, for a sender that must not ask a name server at every datagram.

    Raises `ConfigError`.
    """
    try:
        found = socket.getaddrinfo(host, port, family=socket.AF_INET, type=socket.SOCK_DGRAM)
        return str(found[0][4][0]), port
    except (OSError, UnicodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise ConfigError(f"{host!r} is not a known name or an IPv4 address ({reason})") from None


def join_multicast(group: str, port: int, interface: str) -> socket.socket:
    """A UDP socket that receives only the multicast `group:port`, through the network card at the address `interface`.

    Other programs on this machine may receive the same group. Raises `ListenError`.
    """
    udp = _socket(socket.AF_INET)
    try:
        udp.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if sys.platform == "darwin":
            udp.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        udp.bind(("" if sys.platform == "win32" else group, port))  # Windows cannot bind to a group
        membership = socket.inet_aton(group) + socket.inet_aton(interface)
        udp.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
    except OSError as error:
        udp.close()
        raise ListenError(
            f"cannot join multicast {group}:{port} on interface {interface}: {_reason(error)}; "
            "give the address of the network card that faces the server"
        ) from None
    return udp


def local_address_towards(host: str, port: int) -> str:
    """The address of the network card through which the system would reach `host`. Raises `ListenError`."""
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
            udp.connect((host, port))  # sends nothing
            return udp.getsockname()[0]
    except OSError as error:
        raise ListenError(
            f"no network card of this machine reaches {host}: {_reason(error)}; give the address of one to use"
        ) from None


def _socket(family: int) -> socket.socket:
    udp = socket.socket(family, socket.SOCK_DGRAM)
    with contextlib.suppress(OSError):  # the system may allow less
        udp.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
    return udp


def _reason(error: Exception) -> str:
    number = error.errno if isinstance(error, OSError) else None
    return os.strerror(number) if number is not None and number > 0 else str(error)


def kernel_drops(udp: socket.socket) -> int:
    """The datagrams that the kernel dropped because the socket's buffer was full; 0 if they are not reported."""
    if sys.platform != "linux":
        return 0
    try:
        info = udp.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, 4 * _MEMINFO_WORDS)
    except OSError:
        return 0
    return struct.unpack_from("=I", info, 4 * _MEMINFO_DROPS)[0]
