"""Stops a flood of datagrams in the kernel, where dropping one costs nanoseconds and no space in the socket's buffer.

On Linux, a socket can have a small packet filter (classic BPF, without privileges), which lets the datagrams of known
senders pass, and a random share of all others. Elsewhere, and with IPv6, only `SourceRateLimiter` limits a flood.
"""

import ctypes
import ipaddress
import socket
import struct
import sys
from collections.abc import Collection, Sequence

FLOOD_PER_S = 5_000
"""More unread datagrams per second than this are a flood. About as many still pass while a flood is held back, so a new
sender among them is known within about a tenth of a second."""
WATCH_S = 0.25
CALM_S = 2.0
MAX_KNOWN = 16
_SO_ATTACH_FILTER, _SO_DETACH_FILTER = 26, 27
_LOAD_WORD, _LOAD_HALF, _IF_EQUAL, _IF_AT_LEAST, _RETURN = 0x20, 0x28, 0x15, 0x35, 0x06
_SOURCE_IP = 0xFFF00000 + 12  # relative to the IP header
_SOURCE_PORT = 0  # relative to the UDP header
_RANDOM = 0xFFFFF000 + 56  # a random word instead of packet data
_ALL, _NOTHING = 0xFFFFFFFF, 0


class FloodFilter:
    """The kernel filter of one UDP socket."""

    def __init__(self, udp: socket.socket) -> None:
        self._udp = udp
        self.possible = sys.platform == "linux" and udp.family == socket.AF_INET
        self.engaged = False

    def engage(self, known: Sequence[tuple[str, int]], share: float) -> bool:
        """Let the `known` senders pass, and a random `share` of all others. Returns False if that is impossible."""
        if not self.possible:
            return False
        code = program(known[-MAX_KNOWN:], share)
        buffer = ctypes.create_string_buffer(code, len(code))
        # struct sock_fprog: the number of 8-byte instructions, and their address
        value = struct.pack("HP", len(code) // 8, ctypes.addressof(buffer))
        try:
            self._udp.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, value)
        except OSError:  # a container may forbid it
            self.possible = False
            return False
        self.engaged = True
        return True

    def release(self) -> None:
        """Let every datagram pass again."""
        if self.engaged:
            self._udp.setsockopt(socket.SOL_SOCKET, _SO_DETACH_FILTER, 0)
            self.engaged = False


class FloodWatch:
    """Engages a filter when more than `FLOOD_PER_S` datagrams are not read, and releases it after `CALM_S`."""

    def __init__(self, kernel: FloodFilter) -> None:
        self._kernel = kernel
        self._unread = 0
        self._looked_s = self._flooded_s = float("-inf")
        self._known: set[tuple[str, int]] = set()
        self._share = 1.0

    @property
    def engaged(self) -> bool:
        """Whether the filter is engaged, so that the kernel drops a flood, not what overflows the buffer."""
        return self._kernel.engaged

    def add(self, count: int = 1) -> None:
        """Count datagrams that were not read, since the rate limiter refused them or the filter dropped them."""
        self._unread += count

    def look(self, now_s: float, known: Collection[tuple[str, int]]) -> None:
        """Engage, adjust or release the filter, and let new senders in `known` pass at once. Call this often."""
        if now_s - self._looked_s >= WATCH_S:
            rate_hz = self._unread / (now_s - self._looked_s)
            self._looked_s, self._unread = now_s, 0
            if rate_hz > FLOOD_PER_S:
                self._flooded_s, self._share = now_s, FLOOD_PER_S / rate_hz
                self._engage(known)
            elif now_s - self._flooded_s > CALM_S:
                self._kernel.release()
        elif self.engaged and not self._known.issuperset(known):
            self._engage(known)

    def _engage(self, known: Collection[tuple[str, int]]) -> None:
        self._known = set(known)
        self._kernel.engage(list(known), self._share)


def program(known: Sequence[tuple[str, int]], share: float) -> bytes:
    """The instructions of the filter, 8 bytes each: `(code, jump if true, jump if false, value)`."""
    steps: list[tuple[int, int, int, int]] = []
    for host, port in known:
        steps += [
            (_LOAD_WORD, 0, 0, _SOURCE_IP),
            (_IF_EQUAL, 0, 3, int(ipaddress.IPv4Address(host))),
            (_LOAD_HALF, 0, 0, _SOURCE_PORT),
            (_IF_EQUAL, 0, 1, port),
            (_RETURN, 0, 0, _ALL),
        ]
    steps += [
        (_LOAD_WORD, 0, 0, _RANDOM),
        (_IF_AT_LEAST, 1, 0, round(min(max(share, 0.0), 1.0) * 0xFFFFFFFF)),
        (_RETURN, 0, 0, _ALL),
        (_RETURN, 0, 0, _NOTHING),
    ]
    return b"".join(struct.pack("HBBI", *step) for step in steps)
