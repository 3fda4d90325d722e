"""Reads NatNet frames of the versions 2.7 to 4.5, as pure functions on bytes.

What is not used (markers, assets, force plates, devices) is counted and skipped: from 4.1 on by the byte size that
follows each count, and before by its layout. Before 3.0, each body is followed by its markers. Sources: PacketClient
and the Python client of the NatNet SDK, whose readers name the version of each field. `read_frame` raises
`MessageError` and nothing else.
"""

import struct
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from manipnet.inputs.natnet.cursor import Cursor
from manipnet.inputs.natnet.protocol import Version
from manipnet.wire.bodies import MAX_BODIES, MAX_TIME_S, MessageError
from manipnet.wire.timecode import timecode_text

SIZED: Final[Version] = (4, 1)
"""From this version on, the size in bytes follows each count."""
MODERN: Final[Version] = (3, 0)
"""From this version on, frames have clock stamps, and the markers of bodies are only in the definitions."""

_BODY = struct.Struct("<i3f4ffh")
_POSE_ONLY = struct.Struct("<i3f4f")
_QUALITY = struct.Struct("<fh")
_SUFFIX_2 = struct.Struct("<fIIdH")
_SUFFIX_3 = struct.Struct("<IId3QH")
_SUFFIX_4 = struct.Struct("<IId3Q2IH")
_VECTOR = 12
_MARKER = 20
"""Position, id and size of a marker of a body, before 3.0."""


class RigidBody(NamedTuple):
    """One body as it was streamed: `p` in the server's units and axes, and `q` xyzw, not normalised."""

    id: int
    p: tuple[float, float, float]
    q: tuple[float, float, float, float]
    mean_error: float
    tracked: bool


class Skeleton(NamedTuple):
    """The bones of one skeleton. Their ids count within the skeleton."""

    id: int
    bones: tuple[RigidBody, ...]


class MocapFrame(NamedTuple):
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
    skeletons: tuple[Skeleton, ...] = ()
    timecode: str | None = None
    """HH:MM:SS:FF, or None if there is none."""
    unused: Mapping[str, int] = {}
    """What else is in the frame, and how often."""


def read_frame(payload: bytes, version: Version) -> MocapFrame:
    """Read the payload of a frame packet of the given version."""
    cursor = Cursor(payload)
    sized, has_markers = version >= SIZED, version < MODERN
    unused: dict[str, int] = {}
    number = cursor.int32()
    _skip(cursor, sized, _marker_set)
    _skip(cursor, sized, lambda c: c.skip(_VECTOR), "unlabelled markers", unused)
    bodies = _read_bodies(cursor, sized, has_markers)
    skeletons = _read_skeletons(cursor, sized, has_markers)
    if sized:
        _skip(cursor, sized, _nothing, "assets", unused)  # new in 4.1
    _skip(cursor, sized, lambda c: c.skip(22 if has_markers else 26), "labelled markers", unused)
    if version >= (2, 9):
        _skip(cursor, sized, _analog, "force plates", unused)
    if version >= (2, 11):
        _skip(cursor, sized, _analog, "devices", unused)
    timecode, timestamp_s, stamps, flags = _read_suffix(cursor, version)
    if not abs(timestamp_s) <= MAX_TIME_S:
        raise MessageError(f"NatNet frame {number} has the time {timestamp_s}; it must be finite, in seconds")
    return MocapFrame(
        number,
        bodies,
        timestamp_s,
        *stamps,
        recording=bool(flags & 1),
        models_changed=bool(flags & 2),
        live=bool(flags & 4),
        skeletons=skeletons,
        timecode=timecode_text(timecode),
        unused=unused,
    )


def _read_suffix(cursor: Cursor, version: Version) -> tuple[int, float, tuple[int, int, int], int]:
    """Timecode, time stamp, the three stamps of the clock (zero before 3.0), and flags."""
    if version < MODERN:
        _, timecode, _, timestamp_s, flags = cursor.unpack(_SUFFIX_2)
        return timecode, timestamp_s, (0, 0, 0), flags
    suffix = cursor.unpack(_SUFFIX_4 if version >= (4, 0) else _SUFFIX_3)
    return suffix[0], suffix[2], suffix[3:6], suffix[-1]


def _skip(
    cursor: Cursor, sized: bool, element: Callable[[Cursor], None], name: str = "", unused: dict[str, int] | None = None
) -> None:
    count = cursor.count()
    if count and unused is not None:
        unused[name] = count
    if sized:
        cursor.skip_section()
        return
    for _ in range(count):
        cursor.part()
        element(cursor)


def _read_bodies(cursor: Cursor, sized: bool, has_markers: bool) -> tuple[RigidBody, ...]:
    count = cursor.count()
    if count > MAX_BODIES:
        raise MessageError(f"a NatNet frame has {count} rigid bodies; at most {MAX_BODIES} are allowed")
    extra = 0
    if sized:  # a newer version may add fields to each body; the byte size tells how many bytes
        cursor = cursor.section()
        extra = cursor.left() // count - _BODY.size if count else 0
        if extra < 0:
            raise MessageError(f"a NatNet section of {cursor.left()} bytes announces {count} rigid bodies")
    return _read_all(cursor, count, has_markers, extra)


def _read_all(cursor: Cursor, count: int, has_markers: bool, extra: int = 0) -> tuple[RigidBody, ...]:
    if has_markers:
        return tuple([_read_marked(cursor) for _ in range(count)])
    bodies = cursor.rows(_BODY, count, extra)
    return tuple(
        [
            RigidBody(id, (px, py, pz), (qx, qy, qz, qw), mean_error, params & 1 == 1)
            for id, px, py, pz, qx, qy, qz, qw, mean_error, params in bodies
        ]
    )


def _read_marked(cursor: Cursor) -> RigidBody:
    """A body of a version before 3.0, which is followed by its markers."""
    id, px, py, pz, qx, qy, qz, qw = cursor.unpack(_POSE_ONLY)
    cursor.part()
    cursor.skip(_MARKER * cursor.count())
    mean_error, params = cursor.unpack(_QUALITY)
    return RigidBody(id, (px, py, pz), (qx, qy, qz, qw), mean_error, params & 1 == 1)


def _read_skeletons(cursor: Cursor, sized: bool, has_markers: bool) -> tuple[Skeleton, ...]:
    count = cursor.count()
    if sized:
        cursor = cursor.section()
    skeletons, bones_left = [], MAX_BODIES
    for _ in range(count):
        cursor.part()
        id, bones = cursor.int32(), cursor.count()
        if bones > bones_left:
            if sized:
                break  # the rest is skipped with its section
            raise MessageError(f"a NatNet frame has more than {MAX_BODIES} bones")
        bones_left -= bones
        skeletons.append(Skeleton(id, _read_all(cursor, bones, has_markers)))
    return tuple(skeletons)


def _nothing(cursor: Cursor) -> None:
    pass


def _marker_set(cursor: Cursor) -> None:
    cursor.text()
    cursor.skip(_VECTOR * cursor.count())


def _analog(cursor: Cursor) -> None:
    cursor.skip(4)
    for _ in range(cursor.count()):
        cursor.part()
        cursor.skip(4 * cursor.count())
