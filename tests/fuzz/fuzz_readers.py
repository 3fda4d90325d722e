"""The readers that are fuzzed, each with the only error that it may raise and with good inputs to damage."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import Any

import msgpack
import natnet_writer as natnet
from fuzz_damage import damaged, reshaped
from fuzz_files import ACTORS, RIG, bundles, place_recording, place_rig, read_recording, recordings, toml
from fuzz_imports import IMPORT_TARGETS
from fuzz_senders import (
    DECLARED,
    GOOD_CLOCKS,
    GOOD_DECLARED,
    GOOD_MESSAGES,
    judge_clock,
    read_declared,
    read_messages,
)
from fuzz_takes import FILE_TARGETS
from osc_writer import bundle, osc

from manipnet.common.options import ConfigError
from manipnet.config.rig_reader import load_rig
from manipnet.inputs.natnet.definitions import read_definitions
from manipnet.inputs.natnet.frames import read_frame
from manipnet.inputs.natnet.protocol import read_echo, read_packet, read_server_info
from manipnet.inputs.osc.assembler import FrameAssembler
from manipnet.inputs.osc.packet import split_packet
from manipnet.recording.mcap_file import RecordingError
from manipnet.synthesis.model.bundle import load_bundle
from manipnet.synthesis.model.shipped import BundleError
from manipnet.wire.bodies import MessageError, parse_bodies

VERSIONS = [(3, 0), (3, 1), (4, 0), (4, 1), (4, 2), (4, 5), (2, 7), (2, 9), (2, 10)]


@dataclass(frozen=True)
class Target:
    """A reader: `read` takes what `place` makes of an input, the bytes themselves or a path, and raises only `error`.

    `good[0]` is read after damaged inputs. `documents` are good documents, which `dump` writes as bytes after some of
    their values were replaced.
    """

    read: Callable[[Any], object]
    good: list[bytes]
    error: type[Exception] = MessageError
    documents: tuple[Any, ...] = ()
    dump: Callable[[Any], bytes] = lambda document: json.dumps(document).encode()
    place: Callable[[bytes], Any] = lambda data: data

    def case(self, rng: Random) -> bytes:
        """The next input, which is most probably damaged."""
        if self.documents and rng.random() < 0.5:
            return self.dump(reshaped(rng, rng.choice(self.documents)))
        return damaged(rng, self.good)


def _message(bodies: int) -> dict:
    body = {"p": [0.1, -2.0, 3.0], "q": [0.0, 0.6, 0.0, 0.8], "tracked": True}
    timecode = {"timecode": "10:20:30;04", "timecode_rate": 29.97}
    return timecode | {"t": 1.5, "frame": 7, "bodies": [{"id": n, "name": f"body {n}", **body} for n in range(bodies)]}


def _pack(document: Any) -> bytes:
    return msgpack.packb(document)


def _bodies(data: bytes) -> object:
    return parse_bodies(data, 0.0, "fuzz")


def _osc(data: bytes) -> object:
    assembler = FrameAssembler("fuzz")
    return assembler.add(split_packet(data), 0.0), assembler.flush(1.0)


def _natnet(data: bytes) -> object:
    """Read a packet. The first byte selects the version of the protocol, which a client learns from the server."""
    version = VERSIONS[data[0] % len(VERSIONS)] if data else VERSIONS[0]
    message_id, payload = read_packet(data[1:])
    match message_id:
        case 1:
            return read_server_info(payload)
        case 5:
            return read_definitions(payload, version)
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
        (5, natnet.definitions([(1, "Box"), (1, b"W\xfcrfel")], version, {5: ("Ann", {9: "LHand", 13: "RHand"})})),
        (1, natnet.server_info(version)),
        (13, bytes(range(16))),
    )
]

_BUNDLES = bundles()
_FEW = _message(3)

TARGETS = {
    "msgpack": Target(_bodies, [msgpack.packb(_message(n)) for n in (3, 0, 1, 256)], documents=(_FEW,), dump=_pack),
    "json": Target(_bodies, [json.dumps(_message(n)).encode() for n in (3, 0, 1, 256)], documents=(_FEW,)),
    "osc": Target(_osc, [bundle(*_OSC), *_OSC, bundle(bundle(*_OSC[:3]), bundle(*_OSC[3:]), tag=9), _LARGE]),
    "natnet": Target(_natnet, _NATNET),
    "declared": Target(read_declared, GOOD_DECLARED, ConfigError, (DECLARED,)),
    "declared messages": Target(read_messages, GOOD_MESSAGES),
    "sender clock": Target(judge_clock, GOOD_CLOCKS),
    "rig": Target(load_rig, [toml(RIG), toml(ACTORS)], ConfigError, (RIG, ACTORS), toml, place_rig),
    "recording": Target(read_recording, recordings(), RecordingError, place=place_recording),
}
FILES = FILE_TARGETS | IMPORT_TARGETS
TARGETS |= {name: Target(file.read, file.good, file.error, place=file.place) for name, file in FILES.items()}
if _BUNDLES is not None:
    _META, _DOCUMENTS = _BUNDLES.meta, (json.loads(_BUNDLES.meta),)
    TARGETS |= {
        "bundle": Target(load_bundle, [_META], BundleError, _DOCUMENTS, place=_BUNDLES.place_meta),
        "graph": Target(load_bundle, [_BUNDLES.graph], BundleError, place=_BUNDLES.place_graph),
    }
