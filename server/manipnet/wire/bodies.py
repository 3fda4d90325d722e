"""Body frames, which every receiver produces, and a strict parser of msgpack and JSON messages.

A message that is wrong as a whole (in its type, size, structure or time) raises `MessageError`. One bad pose in a good
message does not spoil the frame: that body becomes untracked, and its `fault` says why.
"""

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeGuard

import msgpack

from manipnet.wire.text import read_text
from manipnet.wire.timecode import MAX_RATE, is_rate, is_timecode

MAX_MESSAGE_BYTES = 65_536
MAX_BODIES = 256
MAX_NAME_CHARS = 128
MAX_COORDINATE_M = 1_000.0
MAX_TIME_S = 1e10
"""The seconds up to the year 2286. A larger time was sent in milliseconds or nanoseconds."""

_FLOATS = {float}
_FAR = MAX_COORDINATE_M
_SMALLEST, _LARGEST = 1e-12, 1e12  # limits of a quaternion's squared length, beyond which it gives no rotation

CONFLICT = "conflict"
FAULTS = ("nan", "bounds", "zero_quaternion", CONFLICT)
"""Why a pose cannot be used: a number is not finite, the position is out of bounds, there is no rotation, or two bodies
have the same id or name."""


class MessageError(ValueError):
    """A message that cannot be used. The text names what is wrong, where, and what is allowed."""


class BodySample(NamedTuple):
    """One body at one instant, in the project frame (right-handed, Y up, metres, xyzw).

    `q` is a unit quaternion. If `tracked` is false, `p` and `q` must not be used. `fault` is one of `FAULTS` if the
    pose that was sent cannot be used; such a body is untracked, at the origin and without rotation.
    """

    id: int | None
    name: str | None
    p: tuple[float, float, float]
    q: tuple[float, float, float, float]
    tracked: bool
    fault: str | None = None


class BodyFrame(NamedTuple):
    """The bodies at one instant: `t_s` on the sender's clock, `t_received_s` on ours (`time.monotonic`).

    `source` identifies the sender: its protocol, a colon, and its address, for example "osc:10.0.0.7:50123".
    """

    t_s: float
    frame: int | None
    bodies: tuple[BodySample, ...]
    t_received_s: float
    source: str
    timecode: str | None = None
    """The SMPTE timecode of the instant, HH:MM:SS:FF, if the sender gives one."""
    timecode_rate: float | None = None
    """The timecode's frames per second, if the sender gives it."""

    def by_key(self) -> "dict[int | str, BodySample]":
        """The bodies by their ids and by their names."""
        ids = {body.id: body for body in self.bodies if body.id is not None}
        names = {body.name: body for body in self.bodies if body.name is not None}
        return {**ids, **names}


def parse_bodies(payload: bytes, t_received_s: float, source: str) -> BodyFrame:
    """Read a msgpack map or a JSON object, as `docs/protocol-in.md` describes them. Raises only `MessageError`."""
    message = _decode(payload)
    if not isinstance(message, dict):
        raise MessageError(f"the message is {_kind(message)}; it must be a map with the keys t, frame and bodies")
    t_s = _number(message, "t", "message")
    if not abs(t_s) <= MAX_TIME_S:
        raise MessageError(f"t is {t_s}; it must be finite, in seconds (not milliseconds), and at most {MAX_TIME_S:g}")
    frame = message.get("frame")
    if frame is not None and not _is_int(frame, 63):
        raise MessageError(f"frame is {_show(frame)}; it must be an integer of at most 63 bits")
    entries = message.get("bodies")
    if not isinstance(entries, list):
        raise MessageError(f"bodies is {_kind(entries)}; it must be a list of maps")
    if len(entries) > MAX_BODIES:
        raise MessageError(f"bodies has {len(entries)} entries; at most {MAX_BODIES} are allowed")
    bodies = tuple([_body(entry, i) for i, entry in enumerate(entries)])
    if len(bodies) > 1:
        check_distinct(bodies)
    timecode, rate = message.get("timecode"), message.get("timecode_rate")
    if timecode is not None and not is_timecode(timecode):
        raise MessageError(f"timecode is {_show(timecode)}; it must be HH:MM:SS:FF, or HH:MM:SS;FF for drop frame")
    if rate is not None and not is_rate(rate):
        raise MessageError(f"timecode_rate is {_show(rate)}; it must be a number above 0 and at most {MAX_RATE:g}")
    return BodyFrame(t_s, frame, bodies, t_received_s, source, timecode, rate)


def bodies_map(frame: BodyFrame) -> dict[str, Any]:
    """The map that `parse_bodies` reads from msgpack or JSON."""
    timecode = {"timecode": frame.timecode, "timecode_rate": frame.timecode_rate}
    return {
        "t": frame.t_s,
        "frame": frame.frame,
        "bodies": [_sample_map(body) for body in frame.bodies],
        **{key: value for key, value in timecode.items() if value is not None},
    }


def _sample_map(body: BodySample) -> dict[str, Any]:
    keys = {"id": body.id, "name": body.name}
    pose = {"p": list(body.p), "q": list(body.q), "tracked": body.tracked}
    return {key: value for key, value in keys.items() if value is not None} | pose


def make_sample(id: int | None, name: str | None, p: Sequence[float], q: Sequence[float], tracked: bool) -> BodySample:
    """A sample with a unit quaternion from three and four floats, or an untracked sample with its fault."""
    px, py, pz = p
    x, y, z, w = q
    squared = x * x + y * y + z * z + w * w
    # Comparisons with NaN are false, so this one condition finds every fault.
    if _SMALLEST < squared < _LARGEST and -_FAR <= px <= _FAR and -_FAR <= py <= _FAR and -_FAR <= pz <= _FAR:
        n = 1.0 / math.sqrt(squared)
        return BodySample(id, name, (px, py, pz), (x * n, y * n, z * n, w * n), tracked)
    # A lost body is often sent as zeros or NaN, which is a fault only if it is also said to be tracked.
    fault = _fault(p, q) if tracked else None
    return BodySample(id, name, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), tracked=False, fault=fault)


def check_distinct(bodies: tuple[BodySample, ...]) -> None:
    """Raise `MessageError` if two bodies of a frame have the same id or name."""
    for key, values in ("id", [body.id for body in bodies]), ("name", [body.name for body in bodies]):
        given = [value for value in values if value is not None]
        if len(set(given)) < len(given):
            twice = next(value for i, value in enumerate(given) if value in given[:i])
            raise MessageError(f"two bodies have the {key} {twice!r}; each body may occur once per frame")


def is_name(name: object) -> TypeGuard[str]:
    """Whether something is the name of a body: 1 to `MAX_NAME_CHARS` printable characters."""
    return isinstance(name, str) and 0 < len(name) <= MAX_NAME_CHARS and name.isprintable()


def check_name(name: object, where: str) -> str:
    """The name of a body, if it is 1 to `MAX_NAME_CHARS` printable characters, which can be logged as they are."""
    if not is_name(name):
        allowed = f"1 to {MAX_NAME_CHARS} printable characters"
        raise MessageError(f"{where} is {_show(name)}; it must be text of {allowed}")
    return name


def _decode(payload: bytes) -> Any:
    if len(payload) > MAX_MESSAGE_BYTES:
        raise MessageError(f"the message has {len(payload)} bytes; at most {MAX_MESSAGE_BYTES} are allowed")
    text = payload.lstrip(b" \t\r\n")
    try:
        if text.startswith((b"{", b"[")):
            return json.loads(read_text(text))
        try:
            return msgpack.unpackb(payload, max_array_len=MAX_BODIES, max_map_len=MAX_BODIES)
        except UnicodeDecodeError:  # a name in another encoding
            raw: Any = {"raw": True, "max_array_len": MAX_BODIES, "max_map_len": MAX_BODIES}
            return _with_text(msgpack.unpackb(payload, **raw))
    except (ValueError, TypeError, OverflowError, RecursionError, msgpack.UnpackException) as error:
        reason = str(error)[:120] or type(error).__name__
        raise MessageError(f"the message is neither a msgpack map nor a JSON object: {reason}") from None


def _with_text(value: Any) -> Any:
    """A value with all bytes in it as text."""
    if isinstance(value, bytes):
        return read_text(value)
    if isinstance(value, list):
        return [_with_text(each) for each in value]
    if isinstance(value, dict):
        return {_with_text(key): _with_text(each) for key, each in value.items()}
    return value


def _body(entry: object, i: int) -> BodySample:
    """The body number `i` of a message."""
    if not isinstance(entry, dict):
        raise MessageError(f"bodies[{i}] is {_kind(entry)}; it must be a map with id or name, p and q")
    id, name = entry.get("id"), entry.get("name") or None  # an empty name is what some languages write for none
    if id is None and name is None:
        raise MessageError(f"bodies[{i}] has neither id nor name; it must have at least one of them")
    if id is not None and not _is_int(id, 31):
        raise MessageError(f"bodies[{i}].id is {_show(id)}; it must be an integer of at most 31 bits")
    if name is not None and not is_name(name):
        check_name(name, f"bodies[{i}].name")
    tracked = entry.get("tracked")
    if tracked is None:
        tracked = True
    elif not isinstance(tracked, bool):
        raise MessageError(f"bodies[{i}].tracked is {_show(tracked)}; it must be true or false")
    p: Any = entry.get("p")
    q: Any = entry.get("q")
    is_usual = type(p) is list and type(q) is list and len(p) == 3 and len(q) == 4
    if not is_usual or {*map(type, p), *map(type, q)} != _FLOATS:
        p, q = _numbers(entry, "p", 3, i), _numbers(entry, "q", 4, i)
    return make_sample(id, name, p, q, tracked)


def _fault(p: Sequence[float], q: Sequence[float]) -> str:
    if not all(map(math.isfinite, (*p, *q))):
        return "nan"
    return "bounds" if max(map(abs, p)) > MAX_COORDINATE_M else "zero_quaternion"


def _numbers(entry: Mapping[str, Any], key: str, count: int, i: int) -> tuple[float, ...]:
    values = entry.get(key)
    if type(values) is not list or len(values) != count:
        raise MessageError(f"bodies[{i}].{key} is {_show(values)}; it must be a list of {count} numbers")
    if {*map(type, values)} == _FLOATS:
        return tuple(values)
    return tuple([_float(value, f"bodies[{i}].{key}[{k}]") for k, value in enumerate(values)])


def _number(entry: Mapping[str, Any], key: str, where: str) -> float:
    if key not in entry:
        raise MessageError(f"{where} has no {key}; it must be a number")
    return _float(entry[key], key)


def _float(value: object, where: str) -> float:
    if type(value) is float:
        return value
    if type(value) is int and abs(value) < 1 << 1023:
        return float(value)
    raise MessageError(f"{where} is {_show(value)}; it must be a number")


def _is_int(value: object, bits: int) -> bool:
    return type(value) is int and -(1 << bits) <= value < 1 << bits


def _kind(value: object) -> str:
    return "missing" if value is None else type(value).__name__


def _show(value: object) -> str:
    """A short, printable form of a value, so that an error text never contains a whole message."""
    if isinstance(value, list | dict):
        return f"a {type(value).__name__} of {len(value)}"
    if isinstance(value, str | bytes) and len(value) > 40:
        return f"{value[:40]!r}…"
    if isinstance(value, int) and abs(value) >= 1 << 64:
        return "a huge integer"
    return "missing" if value is None else repr(value)
