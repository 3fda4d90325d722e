"""Body frames as OSC datagrams, the way `docs/protocol-in.md` lays down: one bundle each, tagged "immediately"."""

import struct
from collections.abc import Sequence
from typing import Final

from manipnet.wire.bodies import BodyFrame, BodySample, MessageError

BUNDLE_BYTES: Final = 12_288
BUNDLE_MESSAGES: Final = 200
"""A frame beyond these becomes several bundles between start and end; receivers take twice as much."""
_IMMEDIATELY: Final = struct.pack(">Q", 1)
_NOT_IN_NAMES: Final = frozenset("/*?[]{}")


def osc_datagrams(frame: BodyFrame) -> list[bytes]:
    """One frame, in one datagram unless it is very large; raises `MessageError` for a name no address can carry."""
    number = (frame.frame or 0) & 0x7FFFFFFF
    bundles = [[_message("/frame/start", ",i", number), _message("/frame/timestamp", ",d", 1e3 * frame.t_s)]]
    size = 0
    for body in frame.bodies:
        messages = _body_messages(body)
        size += sum(map(len, messages))
        if size > BUNDLE_BYTES or len(bundles[-1]) >= BUNDLE_MESSAGES:
            bundles.append([])
            size = sum(map(len, messages))
        bundles[-1] += messages
    bundles[-1].append(_message("/frame/end", ",i", number))
    return [_bundle(messages) for messages in bundles]


def _body_messages(body: BodySample) -> list[bytes]:
    key = str(body.id) if body.name is None else body.name
    if not key.isprintable() or not _NOT_IN_NAMES.isdisjoint(key):
        raise MessageError(f"body {key!r} cannot be sent over OSC; its name may have none of / * ? [ ] {{ }}")
    return [
        _message(f"/rigidbody/{key}/transformation", ",fffffff", *body.p, *body.q),
        _message(f"/rigidbody/{key}/tracked", ",i", int(body.tracked)),
    ]


def _message(address: str, types: str, *values: float) -> bytes:
    return _text(address) + _text(types) + struct.pack(f">{types[1:]}", *values)


def _bundle(messages: Sequence[bytes]) -> bytes:
    elements = b"".join(struct.pack(">i", len(message)) + message for message in messages)
    return b"#bundle\0" + _IMMEDIATELY + elements


def _text(text: str) -> bytes:
    """With one to four zeros at its end, to a multiple of four bytes."""
    raw = text.encode()
    return raw + bytes(4 - len(raw) % 4)
