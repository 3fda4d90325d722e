"""Reads the arguments of an OSC message as one pattern says."""

import re
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from manipnet.inputs.osc.packet import Argument
from manipnet.inputs.osc.patterns import COMPONENTS, EULER, FRAME, KEYS, POSITION, QUATERNION, Pattern
from manipnet.inputs.osc.space import Converter, Numbers
from manipnet.wire.bodies import MAX_TIME_S, MessageError

BodyKey = int | str
KeyOf = Callable[[Mapping[str, Argument], str], BodyKey]
"""The key of the body that the words `body`, or `skeleton` and `bone`, name in a message to some address."""

MOST_KNOWN: Final = 256
"""Texts of bodies whose keys are remembered."""
_FLOATS: Final = {float}
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


class Route(NamedTuple):
    """The content of a message: a field of a body, or of the frame.

    The fields of a body are `position`, `quat`, `transformation`, `local`, `tracked`, `name`, and `parts`, whose values
    are the components `parts` in the sender's own frame, for `converter`. The fields of a frame are `start`, `end`,
    `ms`, `s` and `smpte`. `tracked` is what a message says beside a pose.
    """

    body: BodyKey
    field: str
    values: Numbers
    tracked: float | None = None
    parts: tuple[str, ...] = ()
    converter: Converter | None = None
    text: str = ""


class Reader:
    """Reads the messages to one address by one pattern."""

    def __init__(self, pattern: Pattern, found: re.Match[str], key_of: KeyOf) -> None:
        """`found` is the match of the pattern's address. Raises `MessageError` for a wrong body in the address."""
        self._where, self._words, self._key_of = found.string, pattern.words, key_of
        self._literals = [(i, word[1:]) for i, word in enumerate(self._words) if word.startswith("=")]
        self._keys = [(i, word) for i, word in enumerate(self._words) if word in KEYS]
        self._place = self._keys[0][0] if [word for _, word in self._keys] == ["body"] else None
        """The place of the argument that alone names the body, if there is one."""
        self._bodies: dict[Argument, BodyKey] = {}
        self._groups = {"body": pattern.body} if pattern.body else found.groupdict()
        self._body = key_of(self._groups, self._where) if self._groups and not self._keys else ""
        places = {word: i for i, word in enumerate(self._words)}
        form = tuple(sorted(places.keys() & {*_ORDER}, key=_ORDER.index))
        self._numbers = [places[word] for word in form]
        self._slice = _as_slice(self._numbers)
        self._tracked, self._name = places.get("tracked"), places.get("name")
        self._field = pattern.field or _FIELDS.get(form, form[0] if form and form[0] in FRAME else "parts")
        self._parts = form if self._field == "parts" else ()
        self._has_euler = EULER[0] in form and self._field != "parts"
        self._is_plain = pattern.space.is_ours and not self._has_euler
        self._converter = pattern.space.converter()

    def read(self, arguments: tuple[Argument, ...]) -> Route | None:
        """The content, or None if the arguments belong to another pattern of the address. Raises `MessageError`."""
        for i, literal in self._literals:
            if i >= len(arguments) or not _is_literal(arguments[i], literal):
                return None
        if len(arguments) != len(self._words):
            raise MessageError(f"{self._where} has {len(arguments)} arguments; it must have {self._needed()}")
        body = self._body
        if self._keys:
            body = self._named(arguments)
        if self._name is not None:
            return Route(body, self._field, (), text=str(arguments[self._name]))
        values = arguments[self._slice] if self._slice is not None else tuple([arguments[i] for i in self._numbers])
        if {*map(type, values)} != _FLOATS:
            values = tuple([self._number(value) for value in values])
        tracked = None if self._tracked is None else self._number(arguments[self._tracked])
        return self._route(body, values, tracked)  # type: ignore[arg-type]

    def _named(self, arguments: tuple[Argument, ...]) -> BodyKey:
        """The body that the arguments name."""
        if self._place is not None:
            known = self._bodies.get(text := arguments[self._place])
            if known is not None and type(text) is str:
                return known
        given = {word: arguments[i] for i, word in self._keys}
        body = self._key_of(self._groups | given if self._groups else given, self._where)
        if self._place is not None and len(self._bodies) < MOST_KNOWN:
            self._bodies[arguments[self._place]] = body
        return body

    def _route(self, body: BodyKey, values: Numbers, tracked: float | None) -> Route:
        match self._field:
            case "tracked":
                return Route(body, "tracked", (tracked or 0.0,))
            case "parts":
                return Route(body, "parts", values, tracked, self._parts, self._converter)
            case "start" | "end" | "ms" | "s" | "smpte":
                if not abs(values[0]) <= 1e3 * MAX_TIME_S:
                    raise MessageError(
                        f"{self._where} is {values[0]}; it must be finite and at most {1e3 * MAX_TIME_S:g}"
                    )
            case "position" if not self._is_plain:
                values = self._converter.position(values)
            case "quat" if not self._is_plain:
                values = self._turn(values)
            case _ if not self._is_plain:
                values = self._converter.position(values[:3]) + self._turn(values[3:])
        return Route(body, self._field, values, tracked)

    def _turn(self, values: Numbers) -> Numbers:
        return self._converter.euler(values) if self._has_euler else self._converter.rotation(values)

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


def _is_literal(argument: Argument, literal: str) -> bool:
    if isinstance(argument, str):
        return argument == literal
    return literal.isdigit() and type(argument) in (int, float) and argument == int(literal)


def _as_slice(places: list[int]) -> slice | None:
    """The places as a slice if they are in a row, as they usually are."""
    if places and places == list(range(places[0], places[0] + len(places))):
        return slice(places[0], places[0] + len(places))
    return None
