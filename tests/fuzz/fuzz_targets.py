"""What is fuzzed: for each input a reader, the one error it may raise, and good inputs to damage."""

import json
from collections.abc import Callable
from dataclasses import dataclass

import fuzz_paths  # noqa: F401 (must come before the writers)
import msgpack
import natnet_writer as natnet
from osc_writer import bundle, osc

from manipnet.streams.bodies import MessageError, parse_bodies
from manipnet.streams.natnet import read_echo, read_packet, read_server_info
from manipnet.streams.natnet_frames import read_body_names, read_frame
from manipnet.streams.osc_frames import FrameAssembler
from manipnet.streams.osc_packet import split_packet

VERSIONS = [(3, 0), (3, 1), (4, 0), (4, 1), (4, 2), (4, 5)]


@dataclass(frozen=True)
class Target:
    """`read` takes bytes and raises nothing but `error`; `good[0]` is read after every damaged input."""

    read: Callable[[bytes], object]
    good: list[bytes]
    error: type[Exception] = MessageError


def _message(bodies: int) -> dict:
    body = {"p": [0.1, -2.0, 3.0], "q": [0.0, 0.6, 0.0, 0.8], "tracked": True}
    return {"t": 1.5, "frame": 7, "bodies": [{"id": n, "name": f"body {n}", **body} for n in range(bodies)]}


def _bodies(data: bytes) -> object:
    return parse_bodies(data, 0.0, "fuzz")


def _osc(data: bytes) -> object:
    assembler = FrameAssembler("fuzz")
    return assembler.add(split_packet(data), 0.0), assembler.flush(1.0)


def _natnet(data: bytes) -> object:
    """The version of the frame is in its first byte, as the client knows it from elsewhere."""
    version = VERSIONS[data[0] % len(VERSIONS)] if data else VERSIONS[0]
    message_id, payload = read_packet(data[1:])
    match message_id:
        case 1:
            return read_server_info(payload)
        case 5:
            return read_body_names(payload, version)
        case 7:
            return read_frame(payload, version)
        case 13:
            return read_echo(payload)
    return None


_POSE = (0.5, 1.0, -2.0, 0.0, 0.6, 0.0, 0.8)
_OSC = [
    osc("/frame/start", 7),
    osc("/frame/timestamp", ("d", 1234.5)),
    osc("/rigidbody/Box/transformation", *_POSE),
    osc("/rigidbody/3/position", *_POSE[:3]),
    osc("/rigidbody", 3, "quat", *_POSE[3:]),
    osc("/VMC/Ext/Tra/Pos", "LHR-1234", *_POSE),
    osc("/tracking/trackers/1/rotation", 10.0, 20.0, 30.0),
    osc("/other", 1, "text", b"blob", True, 1.5),
    osc("/frame/end", 7),
]
_LARGE = bundle(_OSC[0], *[osc(f"/rigidbody/{n}/transformation", *_POSE) for n in range(250)], _OSC[-1])
_NATNET = [
    bytes([n]) + natnet.packet(message_id, payload)
    for n, version in enumerate(VERSIONS)
    for message_id, payload in (
        (7, natnet.Frame().write(version)),
        (5, natnet.definitions({1: "Box", 2: "left wrist"}, version)),
        (1, natnet.server_info(version)),
        (13, bytes(range(16))),
    )
]

TARGETS = {
    "msgpack": Target(_bodies, [msgpack.packb(_message(n)) for n in (3, 0, 1, 256)]),
    "json": Target(_bodies, [json.dumps(_message(n)).encode() for n in (3, 0, 1, 256)]),
    "osc": Target(_osc, [bundle(*_OSC), *_OSC, bundle(bundle(*_OSC[:3]), bundle(*_OSC[3:]), tag=9), _LARGE]),
    "natnet": Target(_natnet, _NATNET),
}
