"""Reads NatNet's model definitions of the versions 2.7 to 4.5: which names the streamed ids have.

`read_definitions` raises `MessageError` and nothing else.
"""

from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

from manipnet.inputs.natnet.cursor import Cursor
from manipnet.inputs.natnet.frames import MODERN, SIZED
from manipnet.inputs.natnet.protocol import Version, printable
from manipnet.wire.bodies import MessageError

_VECTOR, _CAMERA_POSE = 12, 28
Expected = frozenset[int | str]


@dataclass(frozen=True, slots=True)
class Definitions:
    """The names that a server defines, as it defines them: several bodies may have one id or one name."""

    bodies: tuple[tuple[int, str], ...] = ()
    """The id and the name of each rigid body."""
    bones: Mapping[tuple[int, int], str] = field(default_factory=dict)
    """The names "skeleton:bone" by the ids of skeleton and bone."""
    skeletons: Mapping[int, str] = field(default_factory=dict)
    """The names of the skeletons by their ids."""

    def names(self) -> dict[int, str]:
        """The names of the rigid bodies that are the only ones with their id and with their name."""
        ids, names = Counter(id for id, _ in self.bodies), Counter(name for _, name in self.bodies)
        return {id: name for id, name in self.bodies if ids[id] == names[name] == 1}

    def conflicts(self) -> list[str]:
        """What is ambiguous, with the remedy."""
        names_of: dict[int, list[str]] = {}
        ids_of: dict[str, list[int]] = {}
        for id, name in self.bodies:
            names_of.setdefault(id, []).append(name)
            ids_of.setdefault(name, []).append(id)
        return [
            f"{' and '.join(map(repr, names))} have the streaming id {id}, so none is used; give each its own id"
            for id, names in names_of.items()
            if len(names) > 1
        ] + [
            f"the streaming ids {' and '.join(map(str, ids))} have the name {name!r}; rename one, or use ids in the rig"
            for name, ids in ids_of.items()
            if len(set(ids)) > 1
        ]


@dataclass(slots=True)
class _Found:
    bodies: list[tuple[int, str]] = field(default_factory=list)
    bones: dict[tuple[int, int], str] = field(default_factory=dict)
    skeletons: dict[int, str] = field(default_factory=dict)


def read_definitions(payload: bytes, version: Version, expected: Expected = frozenset()) -> Definitions:
    """Read the payload of model definitions. `expected` names help to read names that are not written in UTF-8."""
    cursor, found = Cursor(payload), _Found()
    for _ in range(cursor.count()):
        cursor.part()
        kind = cursor.int32()
        if version >= SIZED:
            definition = cursor.section()
            if kind == _BODY:
                _name_body(definition, found, expected)
            elif kind == _SKELETON:
                with suppress(MessageError):  # a newer layout of bones costs only this skeleton
                    _define_skeleton(definition, version, found, expected)
        elif kind in _DEFINITIONS:
            _DEFINITIONS[kind](cursor, version, found, expected)
        else:
            break  # its length is unknown, so what follows cannot be found
    return Definitions(tuple(found.bodies), found.bones, found.skeletons)


def _texts(cursor: Cursor) -> None:
    for _ in range(cursor.count()):
        cursor.part()
        cursor.text()


def _read_body(cursor: Cursor, version: Version, expected: Expected) -> tuple[int, str | None]:
    name, id = printable(cursor.text(), expected), cursor.int32()
    cursor.skip(4 + _VECTOR)  # parent and offset
    if version >= (4, 2):
        cursor.skip(16)  # rotation
    if version >= MODERN:
        count = cursor.count()
        cursor.skip((_VECTOR + 4) * count)  # marker offsets and labels
        if version >= (4, 0):
            for _ in range(count):
                cursor.part()
                cursor.text()
    return id, name


def _define_markers(cursor: Cursor, version: Version, found: _Found, expected: Expected) -> None:
    cursor.text()
    _texts(cursor)


def _name_body(cursor: Cursor, found: _Found, expected: Expected) -> None:
    name, id = printable(cursor.text(), expected), cursor.int32()
    if name is not None:
        found.bodies.append((id, name))


def _define_body(cursor: Cursor, version: Version, found: _Found, expected: Expected) -> None:
    id, name = _read_body(cursor, version, expected)
    if name is not None:
        found.bodies.append((id, name))


def _define_skeleton(cursor: Cursor, version: Version, found: _Found, expected: Expected) -> None:
    skeleton, id = printable(cursor.text(), expected), cursor.int32()
    if skeleton is not None:
        found.skeletons[id] = skeleton
    for _ in range(cursor.count()):
        cursor.part()
        bone_id, bone = _read_body(cursor, version, expected)
        if skeleton is not None and bone is not None:
            # Motive writes the skeleton's name before that of the bone in some of its naming conventions.
            found.bones[id, bone_id & 0xFFFF] = f"{skeleton}:{bone.removeprefix(skeleton).lstrip(':_') or bone}"


def _define_force_plate(cursor: Cursor, version: Version, found: _Found, expected: Expected) -> None:
    cursor.skip(4)
    cursor.text()
    cursor.skip(4 * (2 + 3 + 12 * 12 + 4 * 3 + 2))  # size, origin, calibration, corners, two types
    _texts(cursor)


def _define_device(cursor: Cursor, version: Version, found: _Found, expected: Expected) -> None:
    cursor.skip(4)
    cursor.text()
    cursor.text()
    cursor.skip(8)
    _texts(cursor)


def _define_camera(cursor: Cursor, version: Version, found: _Found, expected: Expected) -> None:
    cursor.text()
    cursor.skip(_CAMERA_POSE)


_BODY, _SKELETON = 1, 2
_DEFINITIONS: Final[dict[int, Callable[[Cursor, Version, _Found, Expected], None]]] = {
    0: _define_markers,
    _BODY: _define_body,
    _SKELETON: _define_skeleton,
    3: _define_force_plate,
    4: _define_device,
    5: _define_camera,
}
"""The reader of each kind of definition. Other kinds can be skipped only if their byte size is told."""
