"""Writes frames as trackers send them, for the section `intake` of `manipnet bench`."""

import struct
from collections.abc import Sequence
from typing import Final

from pythonosc.osc_message import OscMessage

from manipnet.inputs.natnet.protocol import MessageId, write_packet
from manipnet.net.osc import osc_bundle, osc_message
from manipnet.wire.bodies import BodyFrame, BodySample

Datagrams = Sequence[bytes]
"""The datagrams of one frame."""

_VERSION: Final = (4, 2)
_SKELETON: Final = 1
_TRACKED: Final = 1


def osc_messages_of(frame: BodyFrame) -> Datagrams:
    """One datagram for each message, as a NatNet bridge sends them."""
    return [message.dgram for message in _bridge(frame)]


def osc_bundle_of(frame: BodyFrame) -> Datagrams:
    """The same messages in one bundle."""
    return [osc_bundle(_bridge(frame))]


def vmc_of(frame: BodyFrame, bones: int) -> Datagrams:
    """A VMC bundle with a tracker for each body, behind the bones of an avatar."""
    pose = (0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    return [
        osc_bundle(
            [
                osc_message("/VMC/Ext/OK", "i", 1),
                osc_message("/VMC/Ext/T", "f", frame.t_s),
                *(osc_message("/VMC/Ext/Bone/Pos", "sfffffff", f"Bone{i}", *pose) for i in range(bones)),
                *(osc_message("/VMC/Ext/Tra/Pos", "sfffffff", str(b.id), *b.p, *b.q) for b in frame.bodies),
            ]
        )
    ]


def _bridge(frame: BodyFrame) -> list[OscMessage]:
    number = frame.frame or 0
    messages = [osc_message("/frame/start", "i", number), osc_message("/frame/timestamp", "d", 1e3 * frame.t_s)]
    for body in frame.bodies:
        messages.append(osc_message(f"/rigidbody/{body.id}/tracked", "i", int(body.tracked)))
        messages.append(osc_message(f"/rigidbody/{body.id}/transformation", "fffffff", *body.p, *body.q))
    return [*messages, osc_message("/frame/end", "i", number)]


def natnet_packets(frame: BodyFrame, bones: int) -> Datagrams:
    """A NatNet frame with the rigid bodies, and with a skeleton if it has `bones`, which all have the first pose."""
    bodies = b"".join([_natnet_body(body.id or 0, body) for body in frame.bodies])
    skeleton = b"".join([_natnet_body(i, frame.bodies[0]) for i in range(1, bones + 1)])
    sections = [
        _section(0, b""),  # marker sets
        _section(0, b""),  # other markers
        _section(len(frame.bodies), bodies),
        _section(1, struct.pack("<ii", _SKELETON, bones) + skeleton) if bones else _section(0, b""),
        *[_section(0, b"")] * 4,  # assets, labelled markers, force plates, devices
    ]
    suffix = struct.pack("<IId3Q2IH", 0, 0, frame.t_s, 0, 0, 0, 0, 0, 0)
    return [write_packet(MessageId.FRAME, struct.pack("<i", frame.frame or 0) + b"".join(sections) + suffix)]


def natnet_setup(bodies: int, bones: int) -> Datagrams:
    """What a server sends before the frames: its version, and the names of the bodies and of the bones."""
    info = struct.pack("<256s8BQHB4B", b"Motive", 3, 0, 0, 0, *_VERSION, 0, 0, 1_000_000, 1511, 0, 0, 0, 0, 0)
    named = [(1, _definition(f"Body{i}", i)) for i in range(1, bodies + 1)]
    skeleton = b"Ann\0" + struct.pack("<ii", _SKELETON, bones)
    skeleton += b"".join([_definition(f"Bone{i}", i) for i in range(1, bones + 1)])
    definitions = b"".join([struct.pack("<ii", kind, len(each)) + each for kind, each in [*named, (2, skeleton)]])
    return [
        write_packet(MessageId.SERVER_INFO, info),
        write_packet(MessageId.MODEL_DEFINITIONS, struct.pack("<i", bodies + 1) + definitions),
    ]


def _natnet_body(id: int, body: BodySample) -> bytes:
    return struct.pack("<i3f4ffh", id, *body.p, *body.q, 0.0, _TRACKED)


def _section(count: int, content: bytes) -> bytes:
    return struct.pack("<ii", count, len(content)) + content


def _definition(name: str, id: int) -> bytes:
    """A rigid body or a bone: name, id, parent, offset, rotation, and no markers."""
    return name.encode() + b"\0" + struct.pack("<ii3f4fi", id, -1, *(0.0,) * 3, 0.0, 0.0, 0.0, 1.0, 0)
