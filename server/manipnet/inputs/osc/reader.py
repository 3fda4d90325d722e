"""Reads the arguments of an OSC message as one pattern says."""

import re
import struct
from collections.abc import Callable, Mapping, Sequence
from operator import itemgetter
from typing import Final, NamedTuple

from manipnet.inputs.osc.packet import Argument, numbers_layout
from manipnet.inputs.osc.patterns import COMPONENTS, EULER, FRAME, KEYS, POSITION, QUATERNION, Pattern
from manipnet.inputs.osc.space import Converter, Numbers
from manipnet.wire.bodies import MAX_TIME_S, MessageError

BodyKey = int | str
KeyOf = Callable[[Mapping[str, Argument], str], BodyKey]
"""The key of the body that the words `body`, or `skeleton` and `bone`, name in a message to some address."""

_POSE: Final = (*POSITION, *QUATERNION)
_EULER_POSE: Final = (*POSITION, *EULER)
_FIELDS: Final[Mapping[tuple[str, ...], str]] = {
    (): "tracked",
    POSITION: "position",
    QUATERNION: "quat",
    EULER: "quat",
    _POSE: "transformation",
    _EULER_POSE: "transformation",
}
_ORDER: Final = (*COMPONENTS, *FRAME)
_POSES: Final = frozenset(("position", "quat", "transformation", "local"))
_TIMES: Final = frozenset(("start", "end", "ms", "s", "smpte"))


class Route(NamedTuple):
    """What a message is about: a field of a body, or of the frame.

    The fields of a body are `position`, `quat`, `transformation`, `local`, `tracked`, `name`, and `parts`, whose values
    are the components `parts` in the sender's own frame, for `converter`. The fields of a frame are `start`, `end`,
    `ms`, `s` and `smpte`.
    """

    body: BodyKey
    field: str
    parts: tuple[str, ...] = ()
    converter: Converter | None = None
    text: str = ""


class Content(NamedTuple):
    """What a message says: the values of the field in `route`, and whether the body is `tracked`, if it says so."""

    route: Route
    values: Numbers
    tracked: float | None = None


class Reader:
    """Reads the messages to one address by one pattern."""

    def __init__(self, pattern: Pattern, found: re.Match[str], key_of: KeyOf) -> None:
        """`found` is the match of the pattern's address. Raises `MessageError` for a wrong body in the address."""
        self._where, self._words, self._key_of = found.string, pattern.words, key_of
        self._literals = [(i, word[1:]) for i, word in enumerate(self._words) if word.startswith("=")]
        self._keys = [(i, word) for i, word in enumerate(self._words) if word in KEYS]
        self._groups = {"body": pattern.body} if pattern.body else found.groupdict()
        self._body = key_of(self._groups, self._where) if self._groups and not self._keys else ""
        places = {word: i for i, word in enumerate(self._words)}
        form = tuple(sorted(places.keys() & {*_ORDER}, key=_ORDER.index))
        self._tracked, self._name = places.get("tracked"), places.get("name")
        self._field = pattern.field or _FIELDS.get(form, form[0] if form and form[0] in FRAME else "parts")
        if self._field == "tracked" and self._tracked is not None:
            form, self._tracked = ("tracked",), None
        self._places = [places[word] for word in form]
        self._pick = _picker(self._places)
        self._parts = form if self._field == "parts" else ()
        self._converter = pattern.space.converter()
        self._convert = self._conversion(pattern, has_euler=EULER[0] in form)
        deciding = [*self._keys, *self._literals, *([(self._name, "")] if self._name is not None else [])]
        self._decided = 1 + max([i for i, _ in deciding], default=-1)
        """The number of arguments among which are all that decide what the message is about."""

    def route(self, arguments: Sequence[Argument]) -> Route | None:
        """What a message is about, or None if it belongs to another pattern of the address. Raises `MessageError`."""
        for i, literal in self._literals:
            if i >= len(arguments) or not _is_literal(arguments[i], literal):
                return None
        if len(arguments) != len(self._words):
            raise MessageError(f"{self._where} has {len(arguments)} arguments; it must have {self._needed()}")
        body = self._body
        if self._keys:
            body = self._key_of(self._groups | {word: arguments[i] for i, word in self._keys}, self._where)
        text = "" if self._name is None else str(arguments[self._name])
        converter = self._converter if self._parts else None
        return Route(body, self._field, self._parts, converter, text)

    def content(self, route: Route, arguments: tuple[Argument, ...]) -> Content:
        """What a message says about its `route`. Raises `MessageError`."""
        if self._name is not None:
            return Content(route, ())
        values = tuple([self._number(value) for value in self._pick(arguments)])
        tracked = None if self._tracked is None else self._number(arguments[self._tracked])
        return Content(route, values if self._convert is None else self._convert(values), tracked)

    def form(self, route: Route, message: bytes, types: bytes) -> "Form | None":
        """How to read the next messages that begin as this one does, or None if that is not known beforehand.

        `types` are the type tags of the arguments.
        """
        types, count = types[self._decided :], len(types)
        layout = numbers_layout(types)
        if layout is None or count != len(self._words) or self._name is not None:
            return None
        picked = [place - self._decided for place in self._places]
        pick = None if picked == list(range(len(types))) else _picker(picked)
        tracked = None if self._tracked is None else self._tracked - self._decided
        has_floats = {*types} <= {*b"fd"}
        start = len(message) - layout.size
        return Form(route, start, len(message), layout, pick, has_floats, self._convert, tracked)

    def _conversion(self, pattern: Pattern, has_euler: bool) -> Callable[[Numbers], Numbers] | None:
        """What turns the values of the field into ours, or None if they are ours."""
        converter, field = self._converter, self._field
        if field in _TIMES:
            return self._time
        if field not in _POSES or (pattern.space.is_ours and not has_euler):
            return None
        if field == "position":
            return converter.position
        if field == "quat":
            return converter.euler if has_euler else converter.rotation
        return converter.euler_pose if has_euler else converter.pose

    def _time(self, values: Numbers) -> Numbers:
        if not abs(values[0]) <= 1e3 * MAX_TIME_S:
            raise MessageError(f"{self._where} is {values[0]}; it must be finite and at most {1e3 * MAX_TIME_S:g}")
        return values

    def _number(self, value: Argument) -> float:
        """A number of any type. Some senders write numbers as text."""
        if isinstance(value, int | float):
            return float(value)
        try:
            return float(value)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            raise MessageError(f"{self._where} has the argument {value!r:.40}; it must be a number") from None

    def _needed(self) -> str:
        words = [word.removeprefix("=") if word != "-" else "a number" for word in self._words]
        return f"{len(words)}: {', '.join(words)}"


class Form(NamedTuple):
    """How to read messages that begin with the same bytes, the head, which says what they are about.

    A sender repeats its messages from frame to frame, and only the numbers after the head change.
    """

    route: Route
    start: int
    """The size of the head in bytes."""
    size: int
    """The size of the message in bytes."""
    layout: struct.Struct
    """The numbers after the head."""
    pick: Callable[[Numbers], Numbers] | None
    has_floats: bool
    convert: Callable[[Numbers], Numbers] | None
    tracked: int | None

    def read(self, message: bytes) -> Content:
        """What the message says. Raises `MessageError`."""
        route, start, _, layout, pick, has_floats, convert, tracked = self
        numbers = layout.unpack_from(message, start)
        values = numbers if pick is None else pick(numbers)
        if not has_floats:
            values = tuple([float(value) for value in values])
        if convert is not None:
            values = convert(values)
        return Content(route, values, None if tracked is None else float(numbers[tracked]))


def _is_literal(argument: Argument, literal: str) -> bool:
    if isinstance(argument, str):
        return argument == literal
    return literal.isdigit() and type(argument) in (int, float) and argument == int(literal)


def _picker(places: list[int]) -> Callable[[tuple], tuple]:
    """Takes the arguments at these places, which usually are in a row."""
    if not places or places == list(range(places[0], places[-1] + 1)):
        return itemgetter(slice(places[0], places[-1] + 1) if places else slice(0))
    return itemgetter(*places)  # at least two
