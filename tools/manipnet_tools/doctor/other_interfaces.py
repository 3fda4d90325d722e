"""What arrives at this machine's other addresses while the server listens at one: the usual wrong interface."""

import contextlib
import socket
from collections.abc import Iterable
from typing import Final

from manipnet.net.errors import ListenError
from manipnet.net.udp import local_address_towards

SOMEWHERE: Final = "192.0.2.1"
"""An address of no machine (RFC 5737), to learn through which card this one would leave."""


def own_addresses() -> set[str]:
    """The IPv4 addresses of this machine that can be found without asking it to send anything."""
    found = {"127.0.0.1"}
    with contextlib.suppress(OSError):
        found |= {str(info[4][0]) for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)}
    with contextlib.suppress(ListenError):
        found.add(local_address_towards(SOMEWHERE, 9))
    return found


class OtherInterfaces:
    """Counts, without reading, what comes to ports of other addresses than the one that is listened on."""

    def __init__(self, addresses: Iterable[str], udp_port: int, tcp_port: int) -> None:
        self._sockets: list[socket.socket] = []
        for address in addresses:
            self._open(socket.SOCK_DGRAM, address, udp_port)
            self._open(socket.SOCK_STREAM, address, tcp_port)

    def heard(self) -> dict[str, int]:
        """Datagrams and connections by `address:port`, only where there were any; closes everything."""
        counts = {}
        for each in self._sockets:
            host, port = each.getsockname()
            if count := _drain(each):
                counts[f"{host}:{port}"] = count
            each.close()
        return counts

    def _open(self, kind: socket.SocketKind, address: str, port: int) -> None:
        made = socket.socket(socket.AF_INET, kind)
        try:
            made.bind((address, port))
            made.setblocking(False)
            if kind == socket.SOCK_STREAM:
                made.listen()
        except OSError:  # somebody else has it: nothing can be learned there
            made.close()
        else:
            self._sockets.append(made)


def _drain(made: socket.socket) -> int:
    count = 0
    with contextlib.suppress(OSError):
        while count < 10_000:
            if made.type == socket.SOCK_DGRAM:
                made.recv(1)
            else:
                made.accept()[0].close()
            count += 1
    return count
