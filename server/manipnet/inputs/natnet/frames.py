"""Reads NatNet frames and model definitions of the versions 3.0 to 4.5, as pure functions on bytes.

What rigid bodies do not need (markers, skeletons, assets, force plates, devices) is skipped: from 4.1 on by the byte
size that follows each count, and before by its layout. The readers raise `MessageError` and nothing else.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass

from manipnet.inputs.natnet.protocol import Version, printable
from manipnet.wire.bodies import MAX_BODIES, MAX_TIME_S, MessageError

_SIZED: Version = (4, 1)
_MAX_PARTS = 1_024
"""Parts of variable length that one packet may have, so that no packet takes long to read."""
_BODY = struct.Struct("<i3f4ffh")
_SUFFIX_3 = struct.Struct("<IId3QH")
_SUFFIX_4 = struct.Struct("<IId3Q2IH")
_VECTOR, _LABELLED_MARKER, _CAMERA_POSE = 12, 26, 28


@dataclass(frozen=True, slots=True)
class RigidBody:
    """One body as it was streamed: `p` in the server's units and axes, and `q` xyzw, not normalised."""

    id: int
    p: tuple[float, float, float]
    q: tuple[float, float, float, float]
    mean_error: float
    tracked: bool


@dataclass(frozen=True, slots=True)
class MocapFrame:
    """One frame: its rigid bodies, `timestamp_s` since the server started, and time stamps in ticks of its clock."""

    number: int
    bodies: tuple[RigidBody, ...]
    timestamp_s: float
    exposed_ticks: int
    received_ticks: int
    transmitted_ticks: int
    recording: bool
    models_changed: bool
    live: bool


def read_frame(payload: bytes, version: Version) -> MocapFrame:
    """Read the payload of a frame packet of the given version."""
    cursor = _Cursor(payload)
    sized = version >= _SIZED
    number = cursor.int32()
    _skip_elements(cursor, sized, _marker_set)
    _skip_elements(cursor, sized, lambda c: c.skip(_VECTOR))  # other markers
    bodies = _read_bodies(cursor, sized)
    _skip_elements(cursor, sized, _skeleton)
    if sized:
        _skip_elements(cursor, sized, _nothing)  # assets, new in 4.1
    _skip_elements(cursor, sized, lambda c: c.skip(_LABELLED_MARKER))
    _skip_elements(cursor, sized, _analog)  # force plates
    _skip_elements(cursor, sized, _analog)  # devices
    suffix = cursor.unpack(_SUFFIX_4 if version >= (4, 0) else _SUFFIX_3)
    timestamp_s, flags = suffix[2], suffix[-1]
    if not abs(timestamp_s) <= MAX_TIME_S:
        raise MessageError(f"NatNet frame {number} has the time {timestamp_s}; it must be finite, in seconds")
    return MocapFrame(
        number,
        bodies,
        timestamp_s,
        *suffix[3:6],
        recording=bool(flags & 1),
        models_changed=bool(flags & 2),
        live=bool(flags & 4),
    )


def read_body_names(payload: bytes, version: Version) -> dict[int, str]:
    """Read the payload of model definitions: the names of the rigid bodies by streaming id."""
    cursor = _Cursor(payload)
    names: dict[int, str] = {}
    for _ in range(cursor.count()):
        cursor.part()
        kind = cursor.int32()
        if version >= _SIZED:
            definition = cursor.section()
            if kind == 1:
                _name_body(definition, names)
        elif kind in _DEFINITIONS:
            _DEFINITIONS[kind](cursor, version, names)
        else:
            break  # its length is unknown, so what follows cannot be found
    return names


class _Cursor:
    """A position in one payload. It stays within the payload and limits the number of parts."""

    def __init__(self, payload: bytes) -> None:
        self._data = payload
        self._offset = 0
        self._parts = 0

    def skip(self, size: int) -> None:
        if size > self.left():
            raise MessageError(f"a NatNet payload ends at byte {len(self._data)}, where {size} more are needed")
        self._offset += size

    def part(self) -> None:
        self._parts += 1
        if self._parts > _MAX_PARTS:
            raise MessageError(f"a NatNet payload has more than {_MAX_PARTS} parts")

    def unpack(self, layout: struct.Struct) -> tuple:
        start = self._offset
        self.skip(layout.size)
        return layout.unpack_from(self._data, start)

    def int32(self) -> int:
        start = self._offset
        self.skip(4)
        return int.from_bytes(self._data[start : start + 4], "little", signed=True)

    def count(self) -> int:
        count = self.int32()
        if not 0 <= count <= len(self._data):
            raise MessageError(f"a NatNet payload of {len(self._data)} bytes announces {count} elements")
        return count

    def text(self) -> bytes:
        start = self._offset
        end = self._data.find(b"\0", start)
        if end < 0:
            raise MessageError(f"a NatNet text at byte {start} has no end")
        self._offset = end + 1
        return self._data[start:end]

    def left(self) -> int:
        return len(self._data) - self._offset

    def section(self) -> "_Cursor":
        """A cursor over the section whose byte size comes next. This cursor moves behind the section."""
        size = self.int32()
        if not 0 <= size <= self.left():
            raise MessageError(f"a NatNet section announces {size} bytes, but {self.left()} are left")
        start = self._offset
        self.skip(size)
        return _Cursor(self._data[start : start + size])


def _skip_elements(cursor: _Cursor, sized: bool, element: Callable[[_Cursor], None]) -> None:
    count = cursor.count()
    if sized:
        cursor.section()
        return
    for _ in range(count):
        cursor.part()
        element(cursor)


def _read_bodies(cursor: _Cursor, sized: bool) -> tuple[RigidBody, ...]:
    count = cursor.count()
    if count > MAX_BODIES:
        raise MessageError(f"a NatNet frame has {count} rigid bodies; at most {MAX_BODIES} are allowed")
    extra = 0
    if sized:  # a newer version may add fields to each body; the byte size tells how many bytes
        cursor = cursor.section()
        extra = cursor.left() // count - _BODY.size if count else 0
        if extra < 0:
            raise MessageError(f"a NatNet section of {cursor.left()} bytes announces {count} rigid bodies")
    bodies = []
    for _ in range(count):
        id, px, py, pz, qx, qy, qz, qw, mean_error, params = cursor.unpack(_BODY)
        cursor.skip(extra)
        bodies.append(RigidBody(id, (px, py, pz), (qx, qy, qz, qw), mean_error, bool(params & 1)))
    return tuple(bodies)


def _nothing(cursor: _Cursor) -> None:
    pass


def _marker_set(cursor: _Cursor) -> None:
    cursor.text()
    cursor.skip(_VECTOR * cursor.count())


def _skeleton(cursor: _Cursor) -> None:
    cursor.skip(4)
    cursor.skip(_BODY.size * cursor.count())


def _analog(cursor: _Cursor) -> None:
    cursor.skip(4)
    for _ in range(cursor.count()):
        cursor.part()
        cursor.skip(4 * cursor.count())


def _texts(cursor: _Cursor) -> None:
    for _ in range(cursor.count()):
        cursor.part()
        cursor.text()


def _name_body(cursor: _Cursor, names: dict[int, str]) -> None:
    name, id = printable(cursor.text()), cursor.int32()
    if name is not None:
        names[id] = name


def _define_markers(cursor: _Cursor, version: Version, names: dict[int, str]) -> None:
    cursor.text()
    _texts(cursor)


def _define_body(cursor: _Cursor, version: Version, names: dict[int, str]) -> None:
    _name_body(cursor, names)
    cursor.skip(4 + _VECTOR)  # parent and offset
    count = cursor.count()
    cursor.skip((_VECTOR + 4) * count)  # marker offsets and labels
    if version >= (4, 0):
        for _ in range(count):
            cursor.part()
            cursor.text()


def _define_skeleton(cursor: _Cursor, version: Version, names: dict[int, str]) -> None:
    cursor.text()
    cursor.skip(4)
    for _ in range(cursor.count()):
        cursor.part()
        _define_body(cursor, version, {})  # bones have ids of their own


def _define_force_plate(cursor: _Cursor, version: Version, names: dict[int, str]) -> None:
    cursor.skip(4)
    cursor.text()
    cursor.skip(4 * (2 + 3 + 12 * 12 + 4 * 3 + 2))  # size, origin, calibration, corners, two types
    _texts(cursor)


def _define_device(cursor: _Cursor, version: Version, names: dict[int, str]) -> None:
    cursor.skip(4)
    cursor.text()
    cursor.text()
    cursor.skip(8)
    _texts(cursor)


def _define_camera(cursor: _Cursor, version: Version, names: dict[int, str]) -> None:
    cursor.text()
    cursor.skip(_CAMERA_POSE)


_DEFINITIONS = dict(
    enumerate(
        [
            _define_markers,
            _define_body,
            _define_skeleton,
            _define_force_plate,
            _define_device,
            _define_camera,
        ]
    )
)
"""The reader of each kind of definition, for the versions without byte sizes."""
