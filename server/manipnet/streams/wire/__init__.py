"""Hands out: the message, declared once (`schema`), and its two encodings.

A ZeroMQ frame is a topic followed at once by a payload.
"""

from manipnet.streams.wire.binary import decode_binary, encode_binary
from manipnet.streams.wire.checks import check
from manipnet.streams.wire.packed import decode_msgpack, encode_msgpack
from manipnet.streams.wire.schema import (
    SIDES,
    STATES,
    TOPIC_BIN,
    TOPIC_MSGPACK,
    VERSION,
    BodyPose,
    HandPose,
    HandsMessage,
    Latency,
    Side,
    State,
)

__all__ = [
    "SIDES",
    "STATES",
    "TOPIC_BIN",
    "TOPIC_MSGPACK",
    "VERSION",
    "BodyPose",
    "HandPose",
    "HandsMessage",
    "Latency",
    "Side",
    "State",
    "check",
    "decode_binary",
    "decode_msgpack",
    "encode_binary",
    "encode_msgpack",
]
