"""The meaning of OSC messages: the addresses that senders use, matched exactly.

`<body>` is a streaming id if it is a number, and a name otherwise. `docs/protocol-in.md` has a table with examples.
    /rigidbody/<body>/{position, quat, tracked, transformation}     NatNet bridges
    /rigidbody <body> {position, quat, tracked, transformation} …   the same, body and field as arguments
    /frame/start n, /frame/timestamp ms, /frame/end n               NatNet bridges
    /VMC/Ext/{Tra,Con,Hmd}/Pos[/Local] serial p q                   VMC, left-handed
    /tracking/trackers/<body>/{position, rotation}                  VRChat, left-handed, Euler degrees
"""

import math
from functools import lru_cache
from typing import NamedTuple

from manipnet.inputs.osc.packet import Argument, check_address, read_address, read_arguments
from manipnet.wire.bodies import MAX_TIME_S, MessageError, check_name

BodyKey = int | str
Numbers = tuple[float, ...]

_FIELD_SIZES = {"position": 3, "quat": 4, "tracked": 1, "transformation": 7}
_FLOATS = {float}


class Route(NamedTuple):
    """The content of a message: a field of a body, or of the frame (`start`, `end`, `timestamp`)."""

    body: BodyKey
    field: str
    values: Numbers


def read_route(message: bytes) -> Route | None:
    """The content of one OSC message, or None if its address is not one of these. Raises `MessageError`."""
    raw, offset = read_address(message)
    place = _look_up(raw)
    arguments = read_arguments(message, offset)
    if place is None:
        return None
    kind, body, name, count = place
    if kind == "in arguments":  # /rigidbody <body> <field> …
        if len(arguments) < 2 or arguments[1] not in _FIELD_SIZES:
            return None
        name = str(arguments[1])
        body, count, arguments = _body_key(arguments[0], raw), _FIELD_SIZES[name], arguments[2:]
    elif kind == "device":
        if not arguments:
            raise MessageError(f"{raw.decode()} has no arguments; it must have a serial number and 7 numbers")
        body, arguments = _body_key(arguments[0], raw), arguments[1:]
    values = _numbers(arguments, count, raw)
    if kind == "device":
        values = _from_unity(values)
    elif kind == "tracker" and name == "position":
        values = (-values[0], values[1], values[2])
    elif kind == "tracker":
        name, values = "quat", unity_euler_to_quat(*values)
    elif kind == "frame" and not abs(values[0]) <= 1e3 * MAX_TIME_S:
        raise MessageError(f"{raw.decode()} is {values[0]}; it must be finite and at most {1e3 * MAX_TIME_S:g}")
    return Route(body, name, values)


@lru_cache(maxsize=1024)
def _look_up(raw: bytes) -> tuple[str, BodyKey, str, int] | None:
    """`(kind, body, field, count of numbers)` of an address, or None for any other address."""
    match check_address(raw).split("/")[1:]:
        case ["rigidbody", body, str(name)] if name in _FIELD_SIZES:
            return "body", _body_key(body, raw), name, _FIELD_SIZES[name]
        case ["rigidbody"]:
            return "in arguments", "", "", 0
        case ["frame", "start" | "end" | "timestamp" as name]:
            return "frame", "", name, 1
        case ["VMC", "Ext", "Tra" | "Con" | "Hmd", "Pos"]:
            return "device", "", "transformation", 7
        case ["VMC", "Ext", "Tra" | "Con" | "Hmd", "Pos", "Local"]:
            return "device", "", "local", 7
        case ["tracking", "trackers", body, "position" | "rotation" as name]:
            return "tracker", _body_key(body, raw), name, 3
    return None


def _body_key(text: Argument, raw_address: bytes) -> BodyKey:
    """The id of a body that is written in digits, or else its name."""
    if isinstance(text, str):
        if not (text.isascii() and text.isdigit()):
            return check_name(text, f"body in {raw_address.decode()}")
        text = int(text[:11])
    if type(text) is not int or not -(2**31) <= text < 2**31:
        raise MessageError(
            f"body in {raw_address.decode()} is {text!r}; it must be a name or an integer of at most 31 bits"
        )
    return text


def _numbers(arguments: tuple[Argument, ...], count: int, raw_address: bytes) -> Numbers:
    if len(arguments) == count and {*map(type, arguments)} == _FLOATS:
        return arguments  # type: ignore[return-value]
    values = tuple(float(value) for value in arguments if isinstance(value, int | float))
    if not len(values) == len(arguments) == count:
        raise MessageError(f"{raw_address.decode()} has {len(arguments)} arguments; it must have {count} numbers")
    return values


def _from_unity(pose: Numbers) -> Numbers:
    """Convert a pose from Unity's left-handed frame to the project frame by mirroring it through x = 0."""
    x, y, z, qx, qy, qz, qw = pose
    return (-x, y, z, qx, -qy, -qz, qw)


def unity_euler_to_quat(x_deg: float, y_deg: float, z_deg: float) -> Numbers:
    """Convert Unity's Euler angles to a quaternion in the project frame.

    Unity rotates about z, then x, then y, each about a fixed axis, so q = q_y q_x q_z, which is then mirrored through
    x = 0. Sources: Unity's manual on `Transform.eulerAngles`; VRChat's page on OSC trackers, which uses Unity's system.
    """
    if not all(map(math.isfinite, (x_deg, y_deg, z_deg))):
        return (math.nan,) * 4
    (sx, cx), (sy, cy), (sz, cz) = (
        (math.sin(half), math.cos(half)) for half in (math.radians(a) / 2 for a in (x_deg, y_deg, z_deg))
    )
    qx = cy * sx * cz + sy * cx * sz
    qy = sy * cx * cz - cy * sx * sz
    qz = cy * cx * sz - sy * sx * cz
    return (qx, -qy, -qz, cy * cx * cz + sy * sx * sz)
