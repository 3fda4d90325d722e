"""Encodes the hands message as a msgpack map, the payload of the topic `pose/msgpack`."""

import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Any, Final

import msgpack
import numpy as np

from manipnet.geometry import Array
from manipnet.wire.bodies import MessageError
from manipnet.wire.hands import MAX_PAYLOAD_BYTES, BodyPose, HandPose, HandsMessage, Latency
from manipnet.wire.numbers import HAND_SHAPES, LATENCIES, SHIFT_SHAPE
from manipnet.wire.validation import check, known_side, require_version

_ANY: Final = struct.unpack(">d", b"\xffManipN\x01")[0]
"""Stands for a number in a template. No name contains its bytes, because UTF-8 never has the first of them."""
_SMALL_MAP: Final = 0x80
"""The header of a map, to which the number of its entries is added: https://github.com/msgpack/msgpack/blob/master/spec.md"""
_ANY_POSE: Final = {"p": [_ANY] * 3, "q": [_ANY] * 4}


@dataclass(frozen=True)
class _Template:
    """The bytes of a message in which only the numbers and the words at its end change from tick to tick."""

    start: bytes
    """All before the value of `seq`."""
    middle: bytes
    """All from `t_capture` to the latency."""
    places: np.ndarray
    """Where the numbers are in `middle`, in the order of `numbers_of`: big-endian, 8 bytes each."""


def encode_msgpack(message: HandsMessage, numbers: Array | None = None) -> bytes:
    """Encode a message as the map of `docs/protocol.md`.

    `numbers` are what `check` has just returned for the same message. Without them, raises `MessageError` for a message
    that breaks a rule, for example with a number that is not finite.
    """
    numbers = check(message) if numbers is None else numbers
    hands = tuple((side, hand.state, hand.object, hand.wrist_shift is None) for side, hand in message.hands.items())
    bodies = tuple((body.name, bool(body.tracked)) for body in message.bodies)
    template = _template(message.v, message.session, message.actor, hands, bodies, message.hand is None)
    middle = bytearray(template.middle)
    np.ndarray((len(middle) - 7,), ">f8", middle, strides=(1,))[template.places] = numbers
    rate = None if message.timecode_rate is None else float(message.timecode_rate)
    end = {"timecode": message.timecode, "timecode_rate": rate}
    end |= {} if message.hand is None else {"hand": message.hand}
    return b"".join((template.start, _pack(int(message.seq)), middle, _pairs(end)))


@lru_cache(128)
def _template(
    version: int,
    session: str,
    actor: str,
    hands: tuple[tuple[str, str, str | None, bool], ...],
    bodies: tuple[tuple[str, bool], ...],
    of_model: bool,
) -> _Template:
    """The template of all messages with these words.

    A hand is its side, state and object, and whether its wrist is where it is tracked. A body is its name, and
    whether it is tracked.
    """
    hand_maps = {}
    for side, state, thing, unshifted in hands:
        arrays = {name: np.full(shape, _ANY).tolist() for name, shape in HAND_SHAPES}
        hand_maps[side] = {"state": state, "object": thing, "scale": _ANY} | arrays | {"wrist": _ANY_POSE}
        hand_maps[side] |= {} if unshifted else {"wrist_shift": [_ANY] * SHIFT_SHAPE[0]}
    middle = _pairs(
        dict.fromkeys(("t_capture", "t_publish", "look_ahead"), _ANY)
        | {"hands": hand_maps}
        | {"bodies": [{"name": name} | _ANY_POSE | {"tracked": tracked} for name, tracked in bodies]}
        | {"latency_ms": dict.fromkeys(LATENCIES, _ANY)}
    )
    places = [found.start() + 1 for found in re.finditer(re.escape(_pack(_ANY)), middle, re.DOTALL)]
    start = (
        bytes([_SMALL_MAP + (12 if of_model else 13)])
        + _pairs({"v": version, "session": session, "actor": actor})
        + _pack("seq")
    )
    return _Template(start, middle, np.array(places, np.intp))


def _pairs(values: Mapping[str, Any]) -> bytes:
    """The keys and values of a map, without its header."""
    return b"".join(_pack(key) + _pack(value) for key, value in values.items())


def _pack(value: Any) -> bytes:
    payload = msgpack.packb(value)
    assert payload is not None  # only None when msgpack streams into a buffer
    return payload


def decode_msgpack(payload: bytes) -> HandsMessage:
    """The inverse of `encode_msgpack`. Unknown keys are ignored. Raises `MessageError` and nothing else."""
    if len(payload) > MAX_PAYLOAD_BYTES:
        raise MessageError(f"the message has {len(payload)} bytes; at most {MAX_PAYLOAD_BYTES} are allowed")
    try:
        top = msgpack.unpackb(payload, strict_map_key=True)
    except Exception as error:  # msgpack raises a dozen unrelated exceptions for malformed bytes
        raise MessageError(f"the message is not msgpack: {error or type(error).__name__}") from None
    top = _typed(top, dict, "the message", "a map")
    require_version(top.get("v"))
    hands = _get(top, "hands", dict)
    latency = _get(top, "latency_ms", dict)
    message = HandsMessage(
        session=_get(top, "session", str),
        actor=_get(top, "actor", str),
        seq=_get(top, "seq", int),
        t_capture=_number(top, "t_capture"),
        t_publish=_number(top, "t_publish"),
        look_ahead=_number(top, "look_ahead"),
        hands={known_side(side): _hand_value(hand, f"hands.{side}") for side, hand in hands.items()},
        bodies=tuple(_body_value(b, f"bodies[{i}]") for i, b in enumerate(_get(top, "bodies", list))),
        latency_ms=Latency(*(_number(latency, f.name, "latency_ms.") for f in fields(Latency))),
        timecode=None if top.get("timecode") is None else _get(top, "timecode", str),
        timecode_rate=None if top.get("timecode_rate") is None else _number(top, "timecode_rate"),
        hand=None if top.get("hand") is None else _get(top, "hand", str),
    )
    check(message)
    return message


def _hand_value(value: Any, where: str) -> HandPose:
    hand = _typed(value, dict, where, "a map")
    name = hand.get("object")
    return HandPose(
        state=_get(hand, "state", str, f"{where}."),
        object=None if name is None else _typed(name, str, f"{where}.object", "a string or nil"),
        scale=_number(hand, "scale", f"{where}."),
        angles=_array(hand.get("angles"), (20,), f"{where}.angles"),
        rotations=_array(hand.get("rotations"), (17, 4), f"{where}.rotations"),
        wrist=_pose_value(_get(hand, "wrist", dict, f"{where}."), f"{where}.wrist"),
        joints=_array(hand.get("joints"), (26, 7), f"{where}.joints"),
        wrist_shift=None if (shift := hand.get("wrist_shift")) is None else _array(shift, (3,), f"{where}.wrist_shift"),
    )


def _body_value(value: Any, where: str) -> BodyPose:
    body = _typed(value, dict, where, "a map")
    tracked = _get(body, "tracked", bool, f"{where}.")
    return BodyPose(tracked, _pose_value(body, where), _get(body, "name", str, f"{where}."))


def _pose_value(value: dict, where: str) -> Array:
    p = _array(value.get("p"), (3,), f"{where}.p")
    return np.concatenate([p, _array(value.get("q"), (4,), f"{where}.q")])


def _typed(value: Any, kind: type, where: str, allowed: str) -> Any:
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise MessageError(f"{where} is {type(value).__name__}; it must be {allowed}")
    return value


def _get(container: dict, key: str, kind: type, where: str = "") -> Any:
    return _typed(container.get(key), kind, f"{where}{key}", kind.__name__)


def _number(container: dict, key: str, where: str = "") -> float:
    value = container.get(key)
    if not isinstance(value, (int, float)) or isinstance(value, bool) or abs(value) > 1e12:
        raise MessageError(f"{where}{key} is {value!r:.40}; it must be a number of at most 1e12")
    return float(value)


def _array(value: Any, shape: tuple[int, ...], where: str) -> Array:
    try:
        array = np.asarray(value)
    except ValueError:
        array = np.empty(0, object)
    if array.dtype.kind not in "fiu" or array.shape != shape:
        raise MessageError(f"{where} must be an array of numbers of the shape {shape}")
    return array.astype(np.float64)
