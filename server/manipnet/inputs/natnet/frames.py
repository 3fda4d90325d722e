"""Reads NatNet frames of the versions 2.7 to 4.5, as pure functions on bytes.

What is not used (markers, assets, force plates, devices) is counted and skipped: from 4.1 on by the byte size that
follows each count, and before by its layout. Before 3.0, each body is followed by its markers. Sources: PacketClient
and the Python client of the NatNet SDK, whose readers name the version of each field. `read_frame` raises
`MessageError` and nothing else.
"""

import struct
from collections.abc import Callable, Iterable, Mapping
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
    """One body as it was streamed: its position in the server's units and axes, and xyzw, which is not normalised."""

    id: int
    x: float
    y: float
    z: float
    qx: float
    qy: float
    qz: float
    qw: float
    mean_error: float
    params: int

    @property
    def p(self) -> tuple[float, float, float]:
        """The position."""
        return self.x, self.y, self.z

    @property
    def q(self) -> tuple[float, float, float, float]:
        """The quaternion."""
        return self.qx, self.qy, self.qz, self.qw

    @property
    def tracked(self) -> bool:
        """Whether the server sees the body."""
        return self.params & 1 == 1


class Skeleton(NamedTuple):
    """The bones of one skeleton. Their ids count within the skeleton."""

    id: int
    bones: tuple[RigidBody, ...]


_Found = tuple[tuple[RigidBody, ...], tuple[Skeleton, ...]]
"""The bodies and the skeletons of a frame."""


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
    number = cursor.int32()
    unused: dict[str, int] = {}
    bodies, skeletons = (_read_sized if version >= SIZED else _read_plain)(cursor, version, unused)
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


def _read_sized(cursor: Cursor, version: Version, unused: dict[str, int]) -> _Found:
    """Read the sections of a version in which each section states its size."""
    cursor.skip_section()  # marker sets
    _note(unused, "unlabelled markers", cursor.skip_section())
    bodies = _sized_bodies(cursor)
    skeletons = _sized_skeletons(cursor)
    for name in ("assets", "labelled markers", "force plates", "devices"):
        _note(unused, name, cursor.skip_section())
    return bodies, skeletons


def _read_plain(cursor: Cursor, version: Version, unused: dict[str, int]) -> _Found:
    """Read the sections of a version in which only the layout of their elements tells their size."""
    has_markers = version < MODERN
    _skip(cursor, _marker_set)
    _note(unused, "unlabelled markers", _skip(cursor, _vector))
    count = cursor.count()
    _check_count(count)
    bodies = _read_bodies(cursor, count, has_markers)
    skeletons = _plain_skeletons(cursor, has_markers)
    _note(unused, "labelled markers", _skip(cursor, _old_marker if has_markers else _labelled_marker))
    if version >= (2, 9):
        _note(unused, "force plates", _skip(cursor, _analog))
    if version >= (2, 11):
        _note(unused, "devices", _skip(cursor, _analog))
    return bodies, skeletons


def _read_suffix(cursor: Cursor, version: Version) -> tuple[int, float, tuple[int, int, int], int]:
    """Timecode, time stamp, the three stamps of the clock (zero before 3.0), and flags."""
    if version < MODERN:
        _, timecode, _, timestamp_s, flags = cursor.unpack(_SUFFIX_2)
        return timecode, timestamp_s, (0, 0, 0), flags
    suffix = cursor.unpack(_SUFFIX_4 if version >= (4, 0) else _SUFFIX_3)
    return suffix[0], suffix[2], suffix[3:6], suffix[-1]


def _note(unused: dict[str, int], name: str, count: int) -> None:
    if count:
        unused[name] = count


def _skip(cursor: Cursor, element: Callable[[Cursor], None]) -> int:
    """Skip a section, and return the number of its elements."""
    count = cursor.count()
    for _ in range(count):
        cursor.part()
        element(cursor)
    return count


def _check_count(count: int) -> None:
    if count > MAX_BODIES:
        raise MessageError(f"a NatNet frame has {count} rigid bodies; at most {MAX_BODIES} are allowed")


def _sized_bodies(cursor: Cursor) -> tuple[RigidBody, ...]:
    count, size = cursor.head()
    _check_count(count)
    # A newer version may add fields to each body; the size of the section tells how many bytes.
    each = size // count if count else 0
    if count and each < _BODY.size:
        raise MessageError(f"a NatNet section of {size} bytes announces {count} rigid bodies")
    bodies = _made(cursor.rows(_BODY, count, each - _BODY.size if count else 0))
    cursor.skip(size - count * each)
    return bodies


def _made(rows: Iterable[tuple]) -> tuple[RigidBody, ...]:
    return tuple(map(RigidBody._make, rows))


def _read_bodies(cursor: Cursor, count: int, has_markers: bool) -> tuple[RigidBody, ...]:
    if has_markers:
        return tuple([_read_marked(cursor) for _ in range(count)])
    return _made(cursor.rows(_BODY, count))


def _read_marked(cursor: Cursor) -> RigidBody:
    """A body of a version before 3.0, which is followed by its markers."""
    pose = cursor.unpack(_POSE_ONLY)
    cursor.part()
    cursor.skip(_MARKER * cursor.count())
    return RigidBody(*pose, *cursor.unpack(_QUALITY))


def _sized_skeletons(cursor: Cursor) -> tuple[Skeleton, ...]:
    count, size = cursor.head()
    section = cursor.cut(size)
    skeletons: list[Skeleton] = []
    room = MAX_BODIES
    for _ in range(count):
        section.part()
        id, bones = section.int32(), section.count()
        if bones > room:
            break  # the rest is skipped with its section
        room -= bones
        skeletons.append(Skeleton(id, _read_bodies(section, bones, has_markers=False)))
    return tuple(skeletons)


def _plain_skeletons(cursor: Cursor, has_markers: bool) -> tuple[Skeleton, ...]:
    skeletons: list[Skeleton] = []
    room = MAX_BODIES
    for _ in range(cursor.count()):
        cursor.part()
        id, bones = cursor.int32(), cursor.count()
        if bones > room:
            raise MessageError(f"a NatNet frame has more than {MAX_BODIES} bones")
        room -= bones
        skeletons.append(Skeleton(id, _read_bodies(cursor, bones, has_markers)))
    return tuple(skeletons)


def _vector(cursor: Cursor) -> None:
    cursor.skip(_VECTOR)


def _labelled_marker(cursor: Cursor) -> None:
    cursor.skip(26)


def _old_marker(cursor: Cursor) -> None:
    cursor.skip(22)


def _marker_set(cursor: Cursor) -> None:
    cursor.text()
    cursor.skip(_VECTOR * cursor.count())


def _analog(cursor: Cursor) -> None:
    cursor.skip(4)
    for _ in range(cursor.count()):
        cursor.part()
        cursor.skip(4 * cursor.count())
