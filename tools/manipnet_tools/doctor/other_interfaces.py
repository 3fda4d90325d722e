"""Counts what arrives at other addresses of this machine: senders often send to the wrong one."""

import contextlib
import socket
from collections.abc import Iterable
from typing import Final, Literal

from manipnet.net.errors import ListenError
from manipnet.net.udp import local_address_towards

ELSEWHERE: Final = "192.0.2.1"
"""An address that no machine has (RFC 5737), to find the network card for destinations elsewhere."""
MOST_COUNTED: Final = 10_000

Port = tuple[Literal["tcp", "udp"], int]


def own_addresses() -> set[str]:
    """The IPv4 addresses of this machine, as far as they can be found without sending anything."""
    found = {"127.0.0.1"}
    with contextlib.suppress(OSError):
        found |= {str(info[4][0]) for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)}
    with contextlib.suppress(ListenError):
        found.add(local_address_towards(ELSEWHERE, 9))
    return found


class OtherInterfaces:
    """Listens at some ports of `addresses`, and counts what arrives there without reading it."""

    def __init__(self, addresses: Iterable[str], ports: Iterable[Port]) -> None:
        self._sockets: list[socket.socket] = []
        ports = list(ports)
        for address in addresses:
            for transport, port in ports:
                self._open(transport, address, port)

    def counts(self) -> dict[str, int]:
        """Datagrams and connections by `address:port`, where there were any. Closes everything."""
        counts = {}
        for each in self._sockets:
            host, port = each.getsockname()
            if count := _drain(each):
                counts[f"{host}:{port}"] = count
            each.close()
        return counts

    def _open(self, transport: Literal["tcp", "udp"], address: str, port: int) -> None:
        made = socket.socket(socket.AF_INET, socket.SOCK_STREAM if transport == "tcp" else socket.SOCK_DGRAM)
        try:
            made.bind((address, port))
            made.setblocking(False)
            if transport == "tcp":
                made.listen()
        except OSError:  # another program listens there, so nothing can be learned
            made.close()
        else:
            self._sockets.append(made)


def _drain(made: socket.socket) -> int:
    count = 0
    with contextlib.suppress(OSError):
        while count < MOST_COUNTED:
            if made.type == socket.SOCK_DGRAM:
                made.recv(1)
            else:
                made.accept()[0].close()
            count += 1
    return count
