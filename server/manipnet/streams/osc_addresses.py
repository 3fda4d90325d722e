"""What an OSC message means: the addresses in the wild, looked up exactly.

`<body>` is a number (then it is an id) or a name. `docs/protocol-in.md` has the table with examples.
    /rigidbody/<body>/{position, quat, tracked, transformation}     NatNet bridges
    /rigidbody <body> {position, quat, tracked, transformation} …   the same, body and field as arguments
    /frame/start n, /frame/timestamp ms, /frame/end n               NatNet bridges
    /VMC/Ext/{Tra,Con,Hmd}/Pos[/Local] serial p q                   VMC, left-handed
    /tracking/trackers/<body>/{position, rotation}                  VRChat, left-handed, Euler degrees
"""

import math
from dataclasses import dataclass
from functools import lru_cache

from manipnet.streams.bodies import MAX_TIME_S, MessageError, check_name
from manipnet.streams.osc_packet import Argument, read_address, read_arguments

BodyKey = int | str
Numbers = tuple[float, ...]

_FIELD_SIZES = {"position": 3, "quat": 4, "tracked": 1, "transformation": 7}
_KIND_SIZES = {"frame": 1, "device": 7, "tracker": 3}


@dataclass(frozen=True, slots=True)
class Route:
    """What a message says: a field of a body, or of the frame (`start`, `end`, `timestamp`)."""

    body: BodyKey
    field: str
    values: Numbers


def read_route(message: bytes) -> Route | None:
    """The meaning of one OSC message, None when it is not for us; raises `MessageError`."""
    address, offset = read_address(message)
    place = _look_up(address)
    if place is None:
        return None
    kind, body, name = place
    arguments = read_arguments(message, offset)
    if kind == "in arguments":  # /rigidbody <body> <field> …
        if len(arguments) < 2 or arguments[1] not in _FIELD_SIZES:
            return None
        body, name, arguments = _body_key(arguments[0], address), str(arguments[1]), arguments[2:]
    elif kind == "device":
        if not arguments:
            raise MessageError(f"{address} has no arguments; a serial and 7 numbers are expected")
        body, arguments = _body_key(arguments[0], address), arguments[1:]
    values = _numbers(arguments, _KIND_SIZES.get(kind) or _FIELD_SIZES[name], address)
    if kind == "device":
        values = _from_unity(values)
    elif kind == "tracker":
        if name == "position":
            values = (-values[0], values[1], values[2])
        else:
            name, values = "quat", unity_euler_to_quat(*values)
    elif kind == "frame" and not abs(values[0]) <= 1e3 * MAX_TIME_S:
        raise MessageError(f"{address} is {values[0]}; it must be finite, at most {1e3 * MAX_TIME_S:g}")
    return Route(body, name, values)


@lru_cache(maxsize=1024)
def _look_up(address: str) -> tuple[str, BodyKey, str] | None:
    """`(kind, body, field)` of an exact address; None for one that is not ours."""
    match address.split("/")[1:]:
        case ["rigidbody", body, str(name)] if name in _FIELD_SIZES:
            return "body", _body_key(body, address), name
        case ["rigidbody"]:
            return "in arguments", "", ""
        case ["frame", "start" | "end" | "timestamp" as name]:
            return "frame", "", name
        case ["VMC", "Ext", "Tra" | "Con" | "Hmd", "Pos"]:
            return "device", "", "transformation"
        case ["VMC", "Ext", "Tra" | "Con" | "Hmd", "Pos", "Local"]:
            return "device", "", "local"
        case ["tracking", "trackers", body, "position" | "rotation" as name]:
            return "tracker", _body_key(body, address), name
    return None


def _body_key(text: Argument, address: str) -> BodyKey:
    """A body's id when it is written in digits, else its name."""
    if isinstance(text, str):
        if not (text.isascii() and text.isdigit()):
            return check_name(text, f"body in {address}")
        text = int(text[:11])
    if type(text) is not int or not -(2**31) <= text < 2**31:
        raise MessageError(f"body in {address} is {text!r}; it must be a name or an integer of at most 31 bits")
    return text


def _numbers(arguments: tuple[Argument, ...], count: int, address: str) -> Numbers:
    values = tuple(float(value) for value in arguments if isinstance(value, int | float))
    if not len(values) == len(arguments) == count:
        raise MessageError(f"{address} has {len(arguments)} arguments; {count} numbers are expected")
    return values


def _from_unity(pose: Numbers) -> Numbers:
    """A pose in Unity's left-handed frame to ours: mirrored through x = 0."""
    x, y, z, qx, qy, qz, qw = pose
    return (-x, y, z, qx, -qy, -qz, qw)


def unity_euler_to_quat(x_deg: float, y_deg: float, z_deg: float) -> Numbers:
    """Unity's Euler angles to a quaternion of ours.

    Unity turns about z, then x, then y, each about the fixed axes (its manual on `Transform.eulerAngles`, and
    VRChat's page on OSC trackers refers to Unity's system), so q = q_y q_x q_z, then mirrored through x = 0.
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
