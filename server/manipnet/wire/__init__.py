"""The messages of the protocol: bodies, which come in, and hands, which go out in two encodings.

A ZeroMQ frame of hands is a topic, with a space at its end, and a payload.
"""

from manipnet.geometry import SIDES, Side
from manipnet.wire.binary_codec import decode_binary, encode_binary
from manipnet.wire.hands import (
    STATES,
    TOPIC_BIN,
    TOPIC_MSGPACK,
    VERSION,
    BodyPose,
    HandPose,
    HandsMessage,
    Latency,
    State,
    hand_topics,
)
from manipnet.wire.msgpack_codec import decode_msgpack, encode_msgpack
from manipnet.wire.validation import check

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
    "hand_topics",
]
