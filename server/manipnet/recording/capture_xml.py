"""Reads the XML datagrams with which Motive, and other motion capture programs, announce that they record.

    <CaptureStart><Name VALUE="Take 1"/><Notes VALUE="…"/><TimeCode VALUE="10:00:00:00"/><PacketID VALUE="7"/>…
    <CaptureStop><Name VALUE="Take 1"/>…

Source: help.vicon.com, "UDP capture broadcast/trigger". No public specification of what Motive adds was found, so
unknown elements are ignored, and the order and case of names do not matter.
"""

from typing import Final
from xml.parsers.expat import ExpatError, ParserCreate

from manipnet.wire.record_trigger import RecordTrigger

MAX_BYTES: Final = 16_384
MAX_ELEMENTS: Final = 256
MAX_TEXT: Final = 2_000
"""Characters of one value that are kept."""
_KEYS: Final = {
    "notes": "notes",
    "description": "description",
    "timecode": "timecode",
    "assets": "assets",
    "sessionname": "session_name",
    "databasepath": "database_path",
    "hostname": "host_name",
    "processid": "process_id",
}
"""Keys of a recording's metadata by the element's name in lower case."""
_ROOTS: Final = {"capturestart": True, "capturestop": False}


class CaptureError(ValueError):
    """A datagram that is not a trigger. `reason` is a label of the counter `triggers_refused`."""

    def __init__(self, reason: str, text: str) -> None:
        super().__init__(text)
        self.reason = reason


def parse_capture(datagram: bytes, source: str) -> RecordTrigger:
    """The trigger in a datagram. Raises `CaptureError`.

    Declarations of document types and entities are refused, so that nothing is expanded and nothing is loaded.
    """
    if len(datagram) > MAX_BYTES:
        raise CaptureError("oversized", f"it has {len(datagram)} bytes; at most {MAX_BYTES} are allowed")
    values = _Values()
    try:
        values.parser.Parse(datagram.rstrip(b"\0"), True)
    except (ExpatError, ValueError, LookupError) as error:
        if isinstance(error, CaptureError):
            raise
        raise CaptureError("malformed", f"it is not XML ({error})") from None
    starts = _ROOTS.get(values.root)
    if starts is None:
        raise CaptureError("malformed", f"its element is {values.root[:40]!r}; it must be CaptureStart or CaptureStop")
    found = values.found
    about = {key: found[name] for name, key in _KEYS.items() if found.get(name)}
    number = found.get("packetid", "")
    packet = f"{source.rpartition(':')[0]} {found.get('processid', '')} {starts} {number}" if number else ""
    return RecordTrigger(starts, source, found.get("name", ""), about, packet)


class _Values:
    """Collects the value of each element below the root: its attribute VALUE, or else its text."""

    def __init__(self) -> None:
        self.root = ""
        self.found: dict[str, str] = {}
        self._path: list[str] = []
        self._elements = 0
        self.parser = ParserCreate()
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self._begin
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._add
        self.parser.StartDoctypeDeclHandler = _refuse
        self.parser.EntityDeclHandler = _refuse

    def _begin(self, name: str, attributes: dict[str, str]) -> None:
        self._elements += 1
        if self._elements > MAX_ELEMENTS:
            raise CaptureError("malformed", f"it has more than {MAX_ELEMENTS} elements")
        self._path.append(name.lower())
        if len(self._path) == 1:
            self.root = name.lower()
        value = next((text for key, text in attributes.items() if key.lower() in ("value", "name")), "")
        self._add(value)

    def _end(self, _: str) -> None:
        self._path.pop()

    def _add(self, text: str) -> None:
        """Add a text to the element below the root; the values of elements in it are listed."""
        if len(self._path) < 2 or not text.strip():
            return
        before = self.found.get(self._path[1], "")
        self.found[self._path[1]] = (f"{before}, {text.strip()}" if before else text.strip())[:MAX_TEXT]


def _refuse(*_: object) -> None:
    raise CaptureError("doctype", "it declares a document type or an entity, which no trigger needs")
