"""Encodes the hands message as fixed little-endian records, the payload of the topic `pose/bin`.

A header is followed by a record for each hand and a record for each body. The header has the sizes of the records, so a
later writer may append fields, which this reader skips.
"""

import math
import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from manipnet.geometry import SIDES, Array, Side
from manipnet.wire.bodies import MAX_BODIES, MessageError
from manipnet.wire.hands import (
    BODY,
    HAND,
    HEADER,
    LATENCY,
    MAGIC,
    NAME,
    NAME_BYTES,
    PREAMBLE,
    RECORDS,
    STATES,
    TIMED_HEADER,
    VERSION,
    BodyPose,
    HandPose,
    HandsMessage,
    Latency,
)
from manipnet.wire.numbers import HAND_NUMBERS, hand_starts
from manipnet.wire.validation import check, require_version


def encode_binary(message: HandsMessage, numbers: Array | None = None) -> bytes:
    """Encode a message as the records of `docs/protocol.md`. Names are cut to `NAME_BYTES`, between two characters.

    `numbers` are what `check` has just returned for the same message. Without them, raises `MessageError` for a message
    that breaks a rule, for example with a number that is not finite.
    """
    floats = (check(message) if numbers is None else numbers).astype("<f4").tobytes()
    timed = message.timecode is not None
    hands = [
        _hand_record(side, hand, floats[4 * start : 4 * (start + HAND_NUMBERS)])
        for (side, hand), start in zip(message.hands.items(), hand_starts(message), strict=False)
    ]
    bodies = [_BODY.pack(body.tracked, *body.pose.tolist(), _name(body.name)) for body in message.bodies]
    size = (TIMED_HEADER if timed else HEADER).itemsize
    total = size + len(hands) * HAND.itemsize + len(bodies) * BODY.itemsize
    header = _HEADER.pack(
        *(MAGIC, VERSION, size, total, HAND.itemsize, BODY.itemsize, len(hands), len(bodies)),
        *(_name(message.session), _name(message.actor), message.seq),
        *(message.t_capture, message.t_publish, message.look_ahead),
        *(getattr(message.latency_ms, name) for name in LATENCY.names or ()),
    )
    if timed:
        header += _TIMECODE.pack(_name(message.timecode or ""), message.timecode_rate or 0.0)
    return b"".join([header, *hands, *bodies])


def decode_binary(payload: bytes) -> HandsMessage:
    """The inverse of `encode_binary`, up to float32. Of the longer records of a later writer, the known part is read.

    Raises `MessageError` and nothing else.
    """
    header, hands, bodies = _split_records(payload)
    message = HandsMessage(
        **_read(HandsMessage, header, "header"),
        hands={SIDES[_index(r["side"], SIDES, f"hands[{i}].side")]: _hand(r, i) for i, r in enumerate(hands)},
        bodies=tuple(BodyPose(**_read(BodyPose, r, f"bodies[{i}]")) for i, r in enumerate(bodies)),
        latency_ms=Latency(*(float(x) for x in header["latency_ms"].item())),
        **_timecode(header),
    )
    if len(message.hands) != len(hands):
        raise MessageError("a hand occurs twice; a message has at most one left hand and one right hand")
    check(message)
    return message


def _split_records(payload: bytes) -> tuple[np.void, list[np.void], list[np.void]]:
    """The known part of the header, of each hand and of each body."""
    if len(payload) < PREAMBLE.itemsize or payload[:4] != MAGIC:
        raise MessageError(f"the message does not begin with {MAGIC.decode()} and a header, so it is not pose/bin")
    pre = {name: int(value) for name, value in zip(_NUMBERS, _numbers(payload), strict=True)}
    require_version(pre["version"])
    for name, least in (("header", HEADER), ("hand", HAND), ("body", BODY)):
        if pre[f"{name}_size"] < least.itemsize:
            raise MessageError(f"{name}_size is {pre[f'{name}_size']}; it must be at least {least.itemsize}")
    for name, most in (("hand", len(SIDES)), ("body", MAX_BODIES)):
        if pre[f"{name}_count"] > most:
            raise MessageError(f"{name}_count is {pre[f'{name}_count']}; at most {most} are allowed")
    first_body = pre["header_size"] + pre["hand_count"] * pre["hand_size"]
    total = first_body + pre["body_count"] * pre["body_size"]
    if not len(payload) == total == pre["total_size"]:
        raise MessageError(f"the message has {len(payload)} bytes, but its header says {total}")
    return (
        np.frombuffer(payload, TIMED_HEADER if pre["header_size"] >= TIMED_HEADER.itemsize else HEADER, 1)[0],
        _records(payload, HAND, pre["header_size"], pre["hand_size"], pre["hand_count"]),
        _records(payload, BODY, first_body, pre["body_size"], pre["body_count"]),
    )


_NUMBERS = (PREAMBLE.names or ())[1:]


def _numbers(payload: bytes) -> tuple[int, ...]:
    return np.frombuffer(payload, PREAMBLE, 1)[0].item()[1:]


def _records(payload: bytes, dtype: np.dtype, start: int, stride: int, count: int) -> list[np.void]:
    return [np.frombuffer(payload, dtype, 1, start + i * stride)[0] for i in range(count)]


def _hand(record: np.void, index: int) -> HandPose:
    values = _read(HandPose, record, f"hands[{index}]")
    if not record["has_object"]:
        values["object"] = None
    return HandPose(**values)


_CODES: Mapping[str, str] = {"u1": "B", "u2": "H", "u4": "I", "u8": "Q", "f4": "f", "f8": "d", "S4": "4s"}


def _packer(dtype: np.dtype, names: Sequence[str] = (), end: int | None = None) -> struct.Struct:
    """Packs the fields of a record, or those named, from their first to the end of the record or to the byte `end`."""
    end = dtype.itemsize if end is None else end
    places = [place[:2] for name, place in (dtype.fields or {}).items() if not names or name in names]
    places = [(kind, offset) for kind, offset in places if offset < end]
    text, at = "<", places[0][1]
    for kind, offset in places:
        text += "x" * (offset - at) + _code(kind)
        at = offset + kind.itemsize
    return struct.Struct(text + "x" * (end - at))


def _code(kind: np.dtype) -> str:
    if kind == NAME:
        return f"{NAME.itemsize}s"
    if kind == LATENCY:
        return "f" * len(LATENCY.names or ())
    base, shape = kind.subdtype or (kind, ())
    code = _CODES[base.str[1:]]
    return code if base.kind == "S" else f"{math.prod(shape)}{code}"


_HEADER, _BODY = _packer(HEADER), _packer(BODY)
_HAND_WORDS = _packer(HAND, end=(HAND.fields or {})["scale"][1])
"""What comes before the numbers of a hand, which follow one another to the end of its record."""
_TIMECODE = _packer(TIMED_HEADER, ("timecode", "timecode_rate"))


def _hand_record(side: Side, hand: HandPose, numbers: bytes) -> bytes:
    words = SIDES.index(side), hand.object is not None, STATES.index(hand.state), _name(hand.object or "")
    return _HAND_WORDS.pack(*words) + numbers


def _name(name: str) -> bytes:
    text = _cut(name)
    return bytes([len(text)]) + text


def _timecode(header: np.void) -> dict[str, Any]:
    """The timecode of a header that has one, as keyword arguments of `HandsMessage`."""
    if "timecode" not in (header.dtype.names or ()):
        return {}
    text, rate = _text(header["timecode"], "header.timecode"), float(header["timecode_rate"])
    return {"timecode": text or None, "timecode_rate": rate or None}


def _read(cls: type, record: np.void, where: str) -> dict[str, Any]:
    """The fields of a record as keyword arguments of its dataclass."""
    values: dict[str, Any] = {}
    for name, dtype in RECORDS[cls]:
        raw = record[name]
        if dtype == NAME:
            values[name] = _text(raw, f"{where}.{name}")
        elif name == "state":
            values[name] = STATES[_index(raw, STATES, f"{where}.state")]
        elif name == "tracked":
            values[name] = bool(raw)
        else:
            values[name] = raw.astype(np.float64) if raw.shape else raw.item()
    return values


def _cut(text: str) -> bytes:
    return text.encode()[:NAME_BYTES].decode(errors="ignore").encode()


def _text(raw: np.void, where: str) -> str:
    length = int(raw["length"])
    if length > NAME_BYTES:
        raise MessageError(f"{where} has {length} bytes; at most {NAME_BYTES} are allowed")
    try:
        return raw["text"][:length].tobytes().decode()
    except UnicodeDecodeError:
        raise MessageError(f"{where} is not UTF-8") from None


def _index(raw: Any, words: tuple[str, ...], where: str) -> int:
    if not int(raw) < len(words):
        raise MessageError(f"{where} is {int(raw)}; allowed are 0 … {len(words) - 1} ({', '.join(words)})")
    return int(raw)
