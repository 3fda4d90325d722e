"""Finds the meaning of OSC messages: the patterns of `patterns.PATTERNS`, and those that a rig declares."""

from collections.abc import Iterable, Mapping
from typing import Final

from manipnet.inputs.osc.ignored import IgnoredAddress, IgnoredAddresses
from manipnet.inputs.osc.packet import Argument, check_address, read_address, read_arguments, read_types
from manipnet.inputs.osc.patterns import PATTERNS, WITHOUT_BODY, Pattern, with_axes
from manipnet.inputs.osc.reader import BodyKey, Content, Form, Reader
from manipnet.wire.bodies import MessageError, check_name

MOST_CACHED: Final = 2048
"""Addresses whose meaning is remembered. There are more only if a sender makes addresses up."""
MOST_STARTS: Final = 4
"""Heads of different sizes that are remembered for one address. The names of its bodies make them differ."""
MOST_SKELETONS: Final = 64

_Found = tuple[Reader, ...] | MessageError | IgnoredAddress
"""The readers of an address, none if it is not understood; what is wrong with it; or its count if it holds no body."""


class AddressBook:
    """Finds the meaning of the messages that one receiver gets."""

    def __init__(
        self, declared: Iterable[Pattern] = (), axes: str = "y-up", bodies: frozenset[BodyKey] = frozenset()
    ) -> None:
        """`declared` patterns come before those that are always understood; `axes` are those of NatNet bridges.

        `bodies` are those of the rig, which help with names that are not written in UTF-8.
        """
        self._patterns = [(each, each.regex()) for each in (*declared, *with_axes(PATTERNS, axes))]
        self.bodies = bodies
        self._cache: dict[bytes, _Found] = {}
        self._forms: dict[bytes, Form] = {}
        """How to read messages, by their heads."""
        self._starts: dict[bytes, tuple[int, ...]] = {}
        """The sizes of the heads, by the address."""
        self._skeletons: dict[int, str] = {}
        self.ignored = IgnoredAddresses()
        """The messages that were not understood."""
        self.without_body = IgnoredAddresses()
        """The messages that are known to hold nothing about tracked bodies."""

    def read(self, message: bytes, source: str = "", now_s: float = 0.0) -> Content | None:
        """The content of one OSC message, or None if it holds nothing of use. Raises `MessageError`.

        A message whose address or form is not understood is noted in `ignored`, whatever is in it.
        """
        for start in self._starts.get(message[: message.find(b"\0")], ()):
            form = self._forms.get(message[:start])
            if form is not None and form.size == len(message):
                return form.read(message)
        return self._read_unknown(message, source, now_s)

    def name_skeleton(self, number: BodyKey, name: str) -> None:
        """Note the name of a skeleton whose bones are sent with its number."""
        if isinstance(number, int) and len(self._skeletons) < MOST_SKELETONS and self._skeletons.get(number) != name:
            self._skeletons[number] = name
            self._forget_forms()

    def _read_unknown(self, message: bytes, source: str, now_s: float) -> Content | None:
        """The content of a message that does not begin like one that was read before."""
        raw, offset = read_address(message)
        readers = self._cache.get(raw)
        if readers is None:
            readers = self._find(raw)
        if not isinstance(readers, tuple):
            if isinstance(readers, MessageError):
                raise readers
            readers.note(source, now_s)
            return None
        if not readers:
            self.ignored.note(raw, "", source, now_s)
            return None
        arguments = read_arguments(message, offset, self.bodies)
        error: MessageError | None = None
        for reader in readers:
            try:
                route = reader.route(arguments)
                if route is not None:
                    content = reader.content(route, arguments)
                    self._remember(raw, message, reader.form(route, message, read_types(message, offset)))
                    return content
            except MessageError as wrong:
                error = error or wrong
        if error is not None:
            raise error
        self.ignored.note(raw, _form(arguments), source, now_s)
        return None

    def _remember(self, raw: bytes, message: bytes, form: Form | None) -> None:
        """Read the messages that begin like this one by its form from now on."""
        if form is None:
            return
        if len(self._forms) >= MOST_CACHED:
            self._forget_forms()
        starts = self._starts.get(raw, ())
        if form.start not in starts:
            if len(starts) >= MOST_STARTS:
                return
            self._starts[raw] = (*starts, form.start)
        self._forms[message[: form.start]] = form

    def _forget_forms(self) -> None:
        self._forms.clear()
        self._starts.clear()

    def _find(self, raw: bytes) -> _Found:
        if len(self._cache) >= MOST_CACHED:
            self._cache.clear()
        self._cache[raw] = found = self._readers(raw)
        return found

    def _readers(self, raw: bytes) -> _Found:
        try:
            address = check_address(raw, self.bodies)
        except MessageError:
            return ()  # an address that breaks the rules belongs to somebody else
        if address in WITHOUT_BODY:
            return self.without_body.entry(raw)
        found = [(pattern, regex.fullmatch(address)) for pattern, regex in self._patterns]
        try:
            return tuple([Reader(p, match, self._key_of(p)) for p, match in found if match is not None])
        except MessageError as error:
            return error

    def _key_of(self, pattern: Pattern):
        def key(words: Mapping[str, Argument], where: str) -> BodyKey:
            if "bone" in words:
                return self._bone(words["skeleton"], words["bone"], where)
            if "skeleton" in words:
                return body_key(words["skeleton"], where)
            found = body_key(words["body"], where)
            use_alias = pattern.alias in self.bodies and found not in self.bodies
            return pattern.alias if use_alias else found

        return key

    def _bone(self, skeleton: Argument, bone: Argument, where: str) -> str:
        if isinstance(skeleton, int):
            skeleton = self._skeletons.get(skeleton, str(skeleton))
        return check_name(f"{skeleton}:{bone}", f"the bone in {where}")


def body_key(text: Argument, where: str) -> BodyKey:
    """The id of a body that is written in digits, or else its name. Raises `MessageError`."""
    if isinstance(text, str):
        if not (text.isascii() and text.isdigit()):
            return check_name(text, f"body in {where}")
        text = int(text[:11])
    elif isinstance(text, float) and text.is_integer():
        text = int(text)  # some senders know only floats
    if type(text) is not int or not -(2**31) <= text < 2**31:
        raise MessageError(f"body in {where} is {text!r:.40}; it must be a name or an integer of at most 31 bits")
    return text


def _form(arguments: tuple[Argument, ...]) -> str:
    """The word that tells the form of a message, such as "matrix", or else nothing."""
    words = [word for word in arguments[1:3] if isinstance(word, str) and word.isascii() and word.isalpha()]
    return words[0] if words else ""
