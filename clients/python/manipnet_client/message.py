"""A hands message, decoded from `pose/bin`. Axes are right-handed with Y up; metres, radians, quaternions xyzw."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from . import layout

SIDES = ("left", "right")


class MessageError(ValueError):
    """A message cannot be read; the text says what is wrong and what is allowed."""


@dataclass(frozen=True)
class Hand:
    """One hand: `angles (20,)`, `rotations (17, 4)` relative to the parent bone, and `wrist (7,)` and OpenXR
    `joints (26, 7)` in the world.

    `state` is "live", "hold" or "rest". `object` is the object near the hand, or None. `scale` is the size of the hand
    relative to the model's.
    """

    state: str
    object: str | None
    scale: float
    angles: np.ndarray
    rotations: np.ndarray
    wrist: np.ndarray
    joints: np.ndarray


@dataclass(frozen=True)
class Body:
    """A tracked body with its `pose (7,)` in the world."""

    name: str
    tracked: bool
    pose: np.ndarray


@dataclass(frozen=True)
class Hands:
    """Both hands and the tracked bodies at one instant, which is `t_capture` in seconds of the sender's clock.

    `timecode` is the tracker's SMPTE timecode of the instant, "HH:MM:SS:FF" (";" before FF for drop frame), and
    `timecode_rate` its frames per second; both are None where they are not known.
    """

    session: str
    actor: str
    seq: int
    t_capture: float
    t_publish: float
    look_ahead: float
    latency_ms: tuple[float, ...]
    left: Hand | None
    right: Hand | None
    bodies: tuple[Body, ...]
    timecode: str | None = None
    timecode_rate: float | None = None

    def hand(self, side: str) -> Hand | None:
        """The hand of a side, "left" or "right"."""
        return self.left if side == "left" else self.right


def decode(payload: bytes) -> Hands:
    """Decode one `pose/bin` payload; raises `MessageError` and no other error."""
    header, hands, bodies = _records(payload)
    numbers = [float(header[name]) for name in ("t_capture", "t_publish", "look_ahead")]
    latency = header["latency_ms"].astype(float)
    _require_finite("header", np.array(numbers), latency)
    by_side: dict[str, Hand] = {}
    for record in hands:
        side = _word(SIDES, record["side"], "side")
        if side in by_side:
            raise MessageError(f"the {side} hand occurs twice; it may occur once")
        by_side[side] = _hand(record)
    return Hands(
        _text(header["session"]),
        _text(header["actor"]),
        int(header["seq"]),
        numbers[0],
        numbers[1],
        numbers[2],
        tuple(latency.tolist()),
        by_side.get("left"),
        by_side.get("right"),
        tuple(_body(record) for record in bodies),
        *_timecode(payload, int(header["header_size"])),
    )


def _records(payload: bytes) -> tuple[Any, list[Any], list[Any]]:
    if len(payload) < layout.HEADER.itemsize or payload[:4] != layout.MAGIC.to_bytes(4, "little"):
        raise MessageError("the message is not pose/bin; it must begin with MNPL and a complete header")
    header = np.frombuffer(payload, layout.HEADER, 1)[0]
    if header["version"] != layout.VERSION:
        raise MessageError(
            f"the message has version {header['version']}; this client understands version {layout.VERSION}"
        )
    sizes = [int(header[f"{name}_size"]) for name in ("header", "hand", "body")]
    least = [layout.HEADER.itemsize, layout.HAND.itemsize, layout.BODY.itemsize]
    hands, bodies = int(header["hand_count"]), int(header["body_count"])
    if any(size < low for size, low in zip(sizes, least, strict=True)):
        raise MessageError(f"the record sizes are {sizes}; at least {least} are needed")
    if hands > len(SIDES) or bodies > layout.MAX_BODIES:
        raise MessageError(
            f"the message has {hands} hands and {bodies} bodies; at most 2 and {layout.MAX_BODIES} are allowed"
        )
    first_body = sizes[0] + hands * sizes[1]
    total = first_body + bodies * sizes[2]
    if not len(payload) == total == int(header["total_size"]):
        raise MessageError(f"the message has {len(payload)} bytes, but its header says {total}")

    def read(dtype: np.dtype, start: int, stride: int, count: int) -> list[Any]:
        return [np.frombuffer(payload, dtype, 1, start + i * stride)[0] for i in range(count)]

    return (
        header,
        read(layout.HAND, sizes[0], sizes[1], hands),
        read(layout.BODY, first_body, sizes[2], bodies),
    )


def _timecode(payload: bytes, header_size: int) -> tuple[str | None, float | None]:
    """The timecode and its rate, which only a longer header has."""
    if header_size < layout.TIMED_HEADER.itemsize:
        return None, None
    header = np.frombuffer(payload, layout.TIMED_HEADER, 1)[0]
    rate = float(header["timecode_rate"])
    _require_finite("header", np.array(rate))
    return _text(header["timecode"]) or None, rate or None


def _hand(record: Any) -> Hand:
    arrays = [record[name].astype(float) for name in ("angles", "rotations", "wrist", "joints")]
    _require_finite("hand", record["scale"], *arrays)
    name = _text(record["object"]) if record["has_object"] else None
    return Hand(_word(layout.STATES, record["state"], "state"), name, float(record["scale"]), *arrays)


def _body(record: Any) -> Body:
    pose = record["pose"].astype(float)
    _require_finite("body", pose)
    return Body(_text(record["name"]), bool(record["tracked"]), pose)


def _require_finite(where: str, *arrays: Any) -> None:
    if not all(np.isfinite(array).all() for array in arrays):
        raise MessageError(f"the {where} has a number that is not finite")


def _word(words: tuple[str, ...], index: int, what: str) -> str:
    if index >= len(words):
        raise MessageError(f"the {what} is {index}; allowed are 0 to {len(words) - 1} ({', '.join(words)})")
    return words[index]


def _text(raw: np.void) -> str:
    data = raw.tobytes()
    if data[0] > layout.NAME_BYTES:
        raise MessageError(f"a name has {data[0]} bytes; at most {layout.NAME_BYTES} are allowed")
    try:
        return data[1 : 1 + data[0]].decode()
    except UnicodeDecodeError:
        raise MessageError("a name is not UTF-8") from None
