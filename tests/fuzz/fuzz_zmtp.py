"""Conversations with a ZeroMQ port that are broken somewhere: old peers, greetings, mechanisms, commands and frames.

Sources: ZMTP 3.1, https://rfc.zeromq.org/spec/37/; ZMTP 2.0, https://rfc.zeromq.org/spec/15/; ZMTP 1.0,
https://rfc.zeromq.org/spec/13/.
"""

import json
import struct
from random import Random
from typing import Final

import msgpack
from fuzz_damage import damaged, reshaped

SOCKET_TYPES: Final = (
    b"PUB",
    b"SUB",
    b"XPUB",
    b"XSUB",
    b"REQ",
    b"REP",
    b"DEALER",
    b"ROUTER",
    b"PUSH",
    b"PAIR",
    b"?",
    b"",
)
MECHANISMS: Final = (b"NULL", b"PLAIN", b"CURVE", b"GSSAPI", b"null", b"NULLNULLNULLNULLNULL", b"", b"\xff" * 20)
LENGTHS: Final = (0, 1, 255, 256, 65_536, 1 << 20, 2**31 - 1, 2**31, 2**32, 2**63 - 1, 2**63, 2**64 - 1)
"""Lengths that a frame may promise."""
COMMANDS: Final = (
    b"READY",
    b"ERROR",
    b"SUBSCRIBE",
    b"CANCEL",
    b"PING",
    b"PONG",
    b"HELLO",
    b"WELCOME",
    b"INITIATE",
    b"",
)
TOPICS: Final = (b"", b"pose/", b"pose/msgpack ", b"\0", b"x" * 2000)
BODIES: Final = {"t": 1.0, "frame": 1, "bodies": [{"name": "fuzz", "p": [0.0, 1.0, 0.0], "q": [0, 0, 0, 1]}]}
REQUESTS: Final = (
    {"op": "status"},
    {"op": "objects"},
    {"op": "ping", "name": "fuzz", "offset": 0.1, "uncertainty": 0.01},
    {"op": "select_object", "body": "fuzz", "object": "cube", "scale": 1.0},
    {"op": "place_object", "body": "Box", "position": [0, 0, 0], "rotation": [0, 0, 0, 1], "store": False, "extra": 1},
    {"op": "calibrate", "step": "none", "seconds": 0.5, "store": False},
    {"op": "add_object", "file": "/nowhere/mesh.obj", "unit": "m"},
    {"op": "mesh", "body": "Box"},
)
"""Good requests to damage. None of them pauses the hands, so that the other checks still hold when one is met."""


def zmtp_talk(rng: Random) -> list[bytes]:
    """What a peer sends, one part after another."""
    match rng.randrange(8):
        case 0:
            return [rng.randbytes(rng.randrange(1, 400))]
        case 1:
            return _version_1(rng)
        case 2:
            return _version_2(rng)
        case 3:
            return [_greeting(rng, broken=True), _command(rng), _frame(rng, rng.randbytes(20))]
    talk = [_greeting(rng), _ready(rng)]
    talk += [_spoken(rng) for _ in range(rng.randrange(8))]
    return talk if rng.random() < 0.6 else _broken(rng, talk)


def _broken(rng: Random, talk: list[bytes]) -> list[bytes]:
    """A conversation in which one part is damaged or missing, or which is cut off, or which comes in other pieces."""
    k = rng.randrange(len(talk))
    match rng.randrange(4):
        case 0:
            return [*talk[:k], damaged(rng, talk), *talk[k + 1 :]]
        case 1:
            return talk[:k] + talk[k + 1 :]
        case 2:
            return [*talk[:k], talk[k][: rng.randint(0, len(talk[k]))]]
    whole = b"".join(talk)[:2000]
    cuts = sorted(rng.randint(0, len(whole)) for _ in range(6))
    return [whole[a:b] for a, b in zip([0, *cuts], [*cuts, len(whole)], strict=True)]


def _version_1(rng: Random) -> list[bytes]:
    """A peer of ZeroMQ 2: an identity and frames, each after its length and a flag."""
    identity = rng.randbytes(rng.choice((0, 0, 5, 200)))
    frames = b"".join(
        bytes([min(len(content) + 1, 254), rng.choice((0, 0, 1, 255))]) + content
        for content in (_content(rng)[:250] for _ in range(rng.randrange(4)))
    )
    long = b"\xff" + struct.pack(">Q", rng.choice(LENGTHS)) + b"\0" if rng.random() < 0.3 else b""
    return [bytes([len(identity) + 1, 0]) + identity + frames + long]


def _version_2(rng: Random) -> list[bytes]:
    """A peer of ZeroMQ 3: a signature, a revision, a socket type, an identity and frames."""
    revision, kind = rng.choice((0, 1, 1, 1, 2, 255)), rng.randrange(12)
    greeting = b"\xff" + struct.pack(">Q", rng.choice((1, 1, 0, *LENGTHS))) + b"\x7f" + bytes([revision, kind])
    return [greeting, b"\0\0", *(_frame(rng, _content(rng)) for _ in range(rng.randrange(4)))]


def _greeting(rng: Random, broken: bool = False) -> bytes:
    version, mechanism, as_server, filler = (3, rng.choice((0, 1))), b"NULL", 0, bytes(31)
    padding = struct.pack(">Q", rng.choice((0, 1, 1, 2**64 - 1)))
    if broken:
        version = rng.choice((0, 1, 2, 3, 3, 4, 255)), rng.choice((0, 1, 255))
        mechanism, as_server = rng.choice(MECHANISMS), rng.choice((0, 1, 255))
        filler = rng.choice((bytes(31), rng.randbytes(31), rng.randbytes(rng.randrange(60))))
    return b"\xff" + padding + b"\x7f" + bytes(version) + mechanism.ljust(20, b"\0") + bytes([as_server]) + filler


def _ready(rng: Random) -> bytes:
    kind = rng.choice(SOCKET_TYPES)
    properties = [(b"Socket-Type", kind), (b"Identity", rng.randbytes(rng.choice((0, 0, 8, 255, 300))))]
    if rng.random() < 0.3:
        names = (b"", b"Socket-Type", b"Resource", b"x" * 255, rng.randbytes(10))
        properties += [(rng.choice(names), rng.randbytes(rng.randrange(40))) for _ in range(rng.choice((1, 3, 60)))]
    if rng.random() < 0.2:
        rng.shuffle(properties)
        properties.pop()
    return _named(b"READY", b"".join(_property(rng, *each) for each in properties))


def _property(rng: Random, name: bytes, value: bytes) -> bytes:
    length = len(value) if rng.random() < 0.95 else rng.choice(LENGTHS) & 0xFFFFFFFF
    return bytes([len(name)]) + name + struct.pack(">I", length) + value


def _spoken(rng: Random) -> bytes:
    """One command or message of a peer that is connected."""
    match rng.randrange(4):
        case 0:
            return _command(rng)
        case 1:
            return _frame(rng, rng.choice((b"\1", b"\0", b"\2")) + rng.choice(TOPICS))
        case 2:
            return b"\x01\0" + _frame(rng, _content(rng))  # after the empty frame that REQ sends
    return _frame(rng, _content(rng))


def _command(rng: Random) -> bytes:
    name = rng.choice(COMMANDS)
    content = rng.choice((b"", b"\0\x10", b"\0\x10" + b"x" * 16, b"\xff\xff" + bytes(300), rng.choice(TOPICS)))
    return _named(name, content) if rng.random() < 0.8 else _named(name, rng.randbytes(rng.randrange(300)))


def _named(name: bytes, content: bytes) -> bytes:
    body = bytes([len(name)]) + name + content
    if len(body) < 256:
        return bytes([0x04, len(body)]) + body
    return b"\x06" + struct.pack(">Q", len(body)) + body


def _frame(rng: Random, content: bytes) -> bytes:
    flags = rng.choice((0, 0, 0, 1, 2, 3, 4, 5, 6, 8, 0x80, 255)) & ~2
    length = len(content) if rng.random() < 0.9 else rng.choice(LENGTHS)
    if length < 256 and rng.random() < 0.8:
        return bytes([flags, length]) + content
    return bytes([flags | 2]) + struct.pack(">Q", length) + content


def _content(rng: Random) -> bytes:
    """A message of bodies or a request, most probably with something wrong in it."""
    document = reshaped(rng, rng.choice((BODIES, *REQUESTS)))
    try:
        good = json.dumps(document).encode() if rng.random() < 0.5 else msgpack.packb(document) or b""
    except (TypeError, ValueError, OverflowError):  # msgpack has no integers of more than 64 bits
        good = b"{}"
    return damaged(rng, [good]) if rng.random() < 0.5 else good
