"""Reads and writes NatNet packets of OptiTrack Motive (handshake and clock echo), as pure functions on bytes.

A packet consists of a message id and a payload size (uint16 each), then the payload, all little-endian. The module
`frames` reads frames and model definitions. The readers raise `MessageError` and nothing else.
"""

import struct
from collections.abc import Collection
from dataclasses import dataclass
from enum import IntEnum

from manipnet.wire.bodies import MAX_NAME_CHARS, MessageError
from manipnet.wire.text import read_text

Version = tuple[int, int]

OLDEST: Version = (2, 7)
NEWEST: Version = (4, 5)
DATA_PORT = 1511
MULTICAST_GROUP = "239.255.42.99"

_SENDER = struct.Struct("<256s4B4B")
_SERVER = struct.Struct("<QHB4B")


class MessageId(IntEnum):
    CONNECT = 0
    SERVER_INFO = 1
    REQUEST = 2
    RESPONSE = 3
    MODEL_REQUEST = 4
    MODEL_DEFINITIONS = 5
    FRAME = 7
    MESSAGE = 8
    DISCONNECT = 9
    KEEP_ALIVE = 10
    ECHO_REQUEST = 12
    ECHO_RESPONSE = 13
    DISCOVERY = 14
    UNRECOGNISED = 100


@dataclass(frozen=True, slots=True)
class ServerInfo:
    """The server's answer to a connect packet. `clock_hz` is the rate of its time stamps, zero if it has none."""

    application: str
    application_version: tuple[int, int, int, int]
    version: Version
    clock_hz: int
    data_port: int
    multicast_group: str | None


def read_packet(packet: bytes) -> tuple[int, bytes]:
    """The message id and the payload of a packet."""
    if len(packet) < 4:
        raise MessageError(f"a NatNet packet has {len(packet)} bytes; at least 4 are needed")
    message_id, size = struct.unpack_from("<HH", packet)
    if size > len(packet) - 4:
        raise MessageError(f"a NatNet packet announces a payload of {size} bytes, but has {len(packet) - 4}")
    return message_id, packet[4 : 4 + size]


def write_packet(message_id: MessageId, payload: bytes = b"") -> bytes:
    """A packet for the server."""
    return struct.pack("<HH", message_id, len(payload)) + payload


def connect_payload(application: str) -> bytes:
    """The payload of a connect packet: our name, and no version, so that the server uses its own."""
    return _SENDER.pack(application.encode("ascii"), 0, 0, 0, 0, *NEWEST, 0, 0)


def read_server_info(payload: bytes) -> ServerInfo:
    """Read the payload of `SERVER_INFO`."""
    if len(payload) < _SENDER.size:
        raise MessageError(f"the server info has {len(payload)} bytes; at least {_SENDER.size} are needed")
    name, *versions = _SENDER.unpack_from(payload)
    tail = payload[_SENDER.size :]
    if len(tail) < _SERVER.size:  # a bridge that imitates Motive may omit what follows the versions
        tail = _SERVER.pack(0, DATA_PORT, 0, 0, 0, 0, 0)
    clock_hz, data_port, is_multicast, *group = _SERVER.unpack_from(tail)
    if clock_hz >= 10**12 or not data_port:
        raise MessageError(f"the server info names a clock of {clock_hz} Hz and the data port {data_port}")
    return ServerInfo(
        application=printable(name.partition(b"\0")[0]) or "unknown",
        application_version=(versions[0], versions[1], versions[2], versions[3]),
        version=(versions[4], versions[5]),
        clock_hz=clock_hz,
        data_port=data_port,
        multicast_group=".".join(map(str, group)) if is_multicast else None,
    )


def check_version(version: Version) -> None:
    """Raise `MessageError`, which names the remedy, for a version whose frames cannot be read."""
    if not OLDEST <= version < (NEWEST[0] + 1, 0):
        raise MessageError(
            f"the server speaks NatNet {version[0]}.{version[1]}, and this program understands "
            f"{OLDEST[0]}.{OLDEST[1]} (Motive 1) to {NEWEST[0]}.{NEWEST[1]}; update Motive, or this program"
        )


def read_echo(payload: bytes) -> tuple[int, int]:
    """Read `ECHO_RESPONSE`: the time stamp we sent, and the server's clock, in ticks, when it received it."""
    if len(payload) < 16:
        raise MessageError(f"the echo response has {len(payload)} bytes; 16 are needed")
    return struct.unpack_from("<QQ", payload)


def printable(text: bytes, expected: Collection[object] = ()) -> str | None:
    """A name in a packet, or None if it is empty, too long or not printable, and so cannot be logged or matched.

    `expected` names help to read a name that is not written in UTF-8.
    """
    name = read_text(text[: 4 * MAX_NAME_CHARS], expected)
    return name if 0 < len(name) <= MAX_NAME_CHARS and name.isprintable() else None
