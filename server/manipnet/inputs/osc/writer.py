"""Writes body frames as OSC datagrams, as `docs/protocol-in.md` describes: one bundle each, tagged "immediately"."""

from typing import Final

from pythonosc.osc_message import OscMessage

from manipnet.net.osc import osc_bundle, osc_message
from manipnet.wire.bodies import BodyFrame, BodySample, MessageError

BUNDLE_BYTES: Final = 12_288
BUNDLE_MESSAGES: Final = 200
"""A frame beyond these limits becomes several bundles between start and end. The receiver accepts twice as much."""
_NOT_IN_NAMES: Final = frozenset("/*?[]{}")


def osc_datagrams(frame: BodyFrame) -> list[bytes]:
    """One frame, in one datagram unless it is very large. Raises `MessageError` for a name that fits no address."""
    number = (frame.frame or 0) & 0x7FFFFFFF
    bundles = [[osc_message("/frame/start", "i", number), osc_message("/frame/timestamp", "d", 1e3 * frame.t_s)]]
    size = 0
    for body in frame.bodies:
        messages = _body_messages(body)
        size += sum(message.size for message in messages)
        if size > BUNDLE_BYTES or len(bundles[-1]) >= BUNDLE_MESSAGES:
            bundles.append([])
            size = sum(message.size for message in messages)
        bundles[-1] += messages
    bundles[-1].append(osc_message("/frame/end", "i", number))
    return [osc_bundle(messages) for messages in bundles]


def _body_messages(body: BodySample) -> list[OscMessage]:
    key = str(body.id) if body.name is None else body.name
    if not key.isprintable() or not _NOT_IN_NAMES.isdisjoint(key):
        raise MessageError(f"body {key!r} cannot be sent over OSC; its name must not contain / * ? [ ] {{ or }}")
    return [
        osc_message(f"/rigidbody/{key}/transformation", "fffffff", *body.p, *body.q),
        osc_message(f"/rigidbody/{key}/tracked", "i", int(body.tracked)),
    ]
