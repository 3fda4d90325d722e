"""Encodes the hands message as a msgpack map, the payload of the topic `pose/msgpack`."""

from dataclasses import fields
from typing import Any

import msgpack
import numpy as np

from manipnet.geometry import Array
from manipnet.wire.bodies import MessageError
from manipnet.wire.hands import MAX_PAYLOAD_BYTES, BodyPose, HandPose, HandsMessage, Latency
from manipnet.wire.validation import check, known_side, require_version


def encode_msgpack(message: HandsMessage, checked: bool = False) -> bytes:
    """Encode a message as the map of `docs/protocol.md`.

    `checked` means that `check` has just accepted the same message. Raises `MessageError` for a message that
    breaks a rule, for example with a number that is not finite.
    """
    if not checked:
        check(message)
    payload = msgpack.packb(
        {
            "v": message.v,
            "session": message.session,
            "actor": message.actor,
            "seq": int(message.seq),
            "t_capture": float(message.t_capture),
            "t_publish": float(message.t_publish),
            "look_ahead": float(message.look_ahead),
            "hands": {side: _hand_map(hand) for side, hand in message.hands.items()},
            "bodies": [_body_map(body) for body in message.bodies],
            "latency_ms": {f.name: float(getattr(message.latency_ms, f.name)) for f in fields(Latency)},
            "timecode": message.timecode,
            "timecode_rate": None if message.timecode_rate is None else float(message.timecode_rate),
            **({} if message.hand is None else {"hand": message.hand}),
        }
    )
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


def _hand_map(hand: HandPose) -> dict[str, Any]:
    return {
        "state": hand.state,
        "object": hand.object,
        "scale": float(hand.scale),
        "angles": hand.angles.tolist(),
        "rotations": hand.rotations.tolist(),
        "wrist": {"p": hand.wrist[:3].tolist(), "q": hand.wrist[3:].tolist()},
        "joints": hand.joints.tolist(),
        **({} if hand.wrist_shift is None else {"wrist_shift": hand.wrist_shift.tolist()}),
    }


def _body_map(body: BodyPose) -> dict[str, Any]:
    pose = body.pose.tolist()
    return {"name": body.name, "p": pose[:3], "q": pose[3:], "tracked": bool(body.tracked)}


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
