"""What senders state about themselves, as inputs to damage: addresses that a rig declares, and clocks."""

import json
import math
import struct
from collections.abc import Callable
from typing import Any

from osc_writer import bundle, osc

from manipnet.common.options import ConfigError
from manipnet.inputs.osc.addresses import AddressBook
from manipnet.inputs.osc.assembler import FrameAssembler
from manipnet.inputs.osc.declared import Addresses, read_pattern
from manipnet.inputs.osc.packet import split_packet
from manipnet.inputs.sender_clock import SenderClock
from manipnet.wire.bodies import MessageError

DECLARED: list[dict[str, Any]] = [
    {"address": "/stage/<body>", "arguments": "qw qx qy qz x y z", "axes": "z-up", "unit": "mm"},
    {"address": "/t", "arguments": "=pose body rx ry rz - x y z tracked", "rotation_order": "yxz", "angles": "radians"},
    {"address": "/<skeleton>/<bone>/pos", "arguments": "x y z", "axes": "x z -y"},
    {"address": "/<skeleton>/<bone>/rx", "arguments": "rx", "rotation_order": "xyz"},
    {"address": "/clock", "arguments": "s"},
    {"address": "/Box", "arguments": "x y z qx qy qz qw", "body": "Box"},
]
_POSE = (0.5, 1.0, -2.0, 0.0, 0.6, 0.0, 0.8)
_MESSAGES = [
    osc("/stage/Box", *_POSE),
    osc("/t", "pose", "Stick", 0.1, 0.2, 0.3, 7, 1.0, 2.0, 3.0, 1),
    osc("/Ann/LHand/pos", 1.0, 2.0, 3.0),
    osc("/Ann/LHand/rx", 0.5),
    osc("/clock", 12.5),
    osc("/Box", *_POSE),
]
_CLOCK = struct.Struct("<3d")


def read_declared(data: bytes) -> object:
    """Read declarations as a rig file gives them, and what they make of messages."""
    try:
        tables = json.loads(data)
    except (ValueError, RecursionError):
        raise ConfigError("is not JSON") from None
    if not isinstance(tables, list) or not all(isinstance(each, dict) for each in tables):
        raise ConfigError("is not a list of tables")
    patterns = [read_pattern(table) for table in tables]
    assert Addresses().write(tuple(patterns)) is not None
    assembler = FrameAssembler("fuzz", AddressBook(patterns))
    return assembler.add(split_packet(bundle(*_MESSAGES)), 0.0), assembler.flush(1.0)


def read_messages(data: bytes) -> object:
    """Read a packet of a sender whose addresses are declared."""
    assembler = FrameAssembler("fuzz", AddressBook(map(read_pattern, DECLARED)))
    added = assembler.add(split_packet(data), 0.0)
    frames = added.frames + assembler.flush(1.0)
    assert all(math.isfinite(value) for frame in frames for body in frame.bodies for value in (*body.p, *body.q))
    return frames


def judge_clock(data: bytes) -> object:
    """Give a clock three numbers for each frame: two times that it states, and how long after the one before."""
    if len(data) < _CLOCK.size:
        raise MessageError("has no frame")
    clock, now_s, chosen = SenderClock(("one", "other")), 100.0, []
    for at in range(0, len(data) - _CLOCK.size + 1, _CLOCK.size):
        *stated, elapsed_s = _CLOCK.unpack_from(data, at)
        # A receiver refuses times that are not finite, and its own clock rises.
        times_s = tuple(t_s if math.isfinite(t_s) else None for t_s in stated)
        now_s += min(abs(elapsed_s), 1e6) if math.isfinite(elapsed_s) else 0.0
        for each, t_s in zip(clock.clocks, times_s, strict=True):
            if t_s is not None:
                each.note(t_s, now_s)
        chosen.append(clock.choose(times_s, now_s, repeats=False))
    assert all(t_s is None or math.isfinite(t_s) for t_s in chosen)
    assert all(clock.set_aside().values())
    return chosen


def _frames(stated: Callable[[int], tuple[float, float]]) -> bytes:
    return b"".join(_CLOCK.pack(*stated(k), 1 / 120) for k in range(60))


GOOD_DECLARED = [json.dumps(DECLARED).encode()]
GOOD_MESSAGES = [bundle(*_MESSAGES), *_MESSAGES]
GOOD_CLOCKS = [
    _frames(lambda k: (k / 120, 5.0)),
    _frames(lambda k: (7.0, k / 120)),
    _frames(lambda k: (k / 120 % 0.5, 1000 * k / 120)),
    _frames(lambda k: (math.floor(k / 120), math.nan)),
]
