"""A strict reader of Open Sound Control 1.0: it checks sizes, nesting, types and text before it uses them.

python-osc is not used to read datagrams from outside: its parser loops forever on a negative element size, runs out of
stack on deep nesting, raises decoding errors and treats `*` in an address as a regular expression.
"""

import struct
from collections.abc import Iterator
from functools import lru_cache
from itertools import islice

from manipnet.wire.bodies import MessageError

MAX_DATAGRAM_BYTES = 24_576
MAX_MESSAGES = 256
MAX_DEPTH = 4
MAX_ADDRESS_BYTES = 256
MAX_ARGUMENTS = 64
IMMEDIATELY = 1
NTP_TO_UNIX_S = 2_208_988_800

Argument = int | float | str | bytes | bool | None

_BUNDLE = b"#bundle\0"
_STRUCT_OF = {"i": "i", "f": "f", "h": "q", "d": "d", "t": "Q", "r": "I", "c": "I", "m": "I"}
_CONSTANTS: dict[str, Argument] = {"T": True, "F": False, "N": None, "I": True}
_NUMBERS = frozenset(b"ifhd")
_PATTERN = frozenset("*?[]{}")


def split_packet(data: bytes) -> list[tuple[int, bytes]]:
    """`(time tag, message)` of each message in a datagram, in order. Raises `MessageError`.

    A message has the time tag of the innermost bundle around it whose tag is not "immediately".
    """
    if not 4 <= len(data) <= MAX_DATAGRAM_BYTES:
        raise MessageError(f"the datagram has {len(data)} bytes; 4 to {MAX_DATAGRAM_BYTES} are allowed")
    messages = list(islice(_elements(data, IMMEDIATELY, 0), MAX_MESSAGES + 1))
    if len(messages) > MAX_MESSAGES:
        raise MessageError(f"the bundle has more than {MAX_MESSAGES} messages")
    return messages


def _elements(data: bytes, time_tag: int, depth: int) -> Iterator[tuple[int, bytes]]:
    if len(data) % 4:
        raise MessageError(f"an OSC element has {len(data)} bytes; the length must be a multiple of 4")
    if data[:1] == b"/":
        yield time_tag, data
        return
    if data[:8] != _BUNDLE or len(data) < 16:
        raise MessageError(f"an OSC element begins with {data[:8]!r}; it must be '/', or '#bundle' and a time tag")
    if depth == MAX_DEPTH:
        raise MessageError(f"bundles are nested deeper than {MAX_DEPTH}")
    own_tag = int.from_bytes(data[8:16], "big")
    position = 16
    while position < len(data):
        size = int.from_bytes(data[position : position + 4], "big", signed=True)
        position += 4
        if not 4 <= size <= len(data) - position:
            raise MessageError(f"a bundle element has the size {size}, but {len(data) - position} bytes are left")
        tag = time_tag if own_tag == IMMEDIATELY else own_tag
        yield from _elements(data[position : position + size], tag, depth + 1)
        position += size


def read_address(message: bytes) -> tuple[bytes, int]:
    """The raw address, which `check_address` checks, and the offset of what follows it. Raises `MessageError`."""
    end, after = _text_end(message, 0, "address")
    return message[:end], after


def check_address(raw: bytes) -> str:
    """The text of an address, if it is allowed. Raises `MessageError`."""
    address = _decode(raw, "address")
    if len(raw) > MAX_ADDRESS_BYTES or not address.isprintable() or not _PATTERN.isdisjoint(address):
        allowed = f"at most {MAX_ADDRESS_BYTES} printable characters without any of * ? [ ] {{ }}"
        raise MessageError(f"the OSC address is {address[:40]!r}; it must have {allowed}")
    return address


def read_arguments(message: bytes, offset: int) -> tuple[Argument, ...]:
    """The arguments from the offset that `read_address` returned. Raises `MessageError`."""
    if offset == len(message):
        return ()  # old senders omit the type tags of a message without arguments
    end, after = _text_end(message, offset, "type tag string")
    tags = message[offset:end]
    layout = _numbers_layout(tags)
    if layout is not None and after + layout.size == len(message):
        return layout.unpack_from(message, after)
    return _read_any(_decode(tags, "type tag string"), message, after)


@lru_cache(maxsize=64)
def _numbers_layout(tags: bytes) -> struct.Struct | None:
    """The layout of arguments that are all numbers, as poses are, or None for other arguments."""
    if tags[:1] != b"," or len(tags) > MAX_ARGUMENTS + 1 or not _NUMBERS.issuperset(tags[1:]):
        return None
    return struct.Struct(">" + "".join(_STRUCT_OF[tag] for tag in tags[1:].decode()))


def _read_any(tags: str, message: bytes, offset: int) -> tuple[Argument, ...]:
    if not tags.startswith(",") or len(tags) > MAX_ARGUMENTS + 1:
        raise MessageError(f"OSC type tags are {tags[:20]!r}; they must be ',' and at most {MAX_ARGUMENTS} types")
    arguments: list[Argument] = []
    for tag in tags[1:]:
        if tag in _STRUCT_OF:
            size = 8 if tag in "hdt" else 4
            if offset + size > len(message):
                raise MessageError(f"an OSC argument of type {tag!r} is cut off at byte {len(message)}")
            arguments += struct.unpack_from(">" + _STRUCT_OF[tag], message, offset)
            offset += size
        elif tag in "sS":
            end, after = _text_end(message, offset, "text argument")
            arguments.append(_decode(message[offset:end], "text argument"))
            offset = after
        elif tag == "b":
            blob, offset = _read_blob(message, offset)
            arguments.append(blob)
        elif tag in _CONSTANTS:
            arguments.append(_CONSTANTS[tag])
        elif tag not in "[]":  # the members of an array are read as plain arguments
            raise MessageError(f"OSC type {tag!r} is unknown; allowed are {''.join(_STRUCT_OF)}sSbTFNI[]")
    if offset != len(message):
        raise MessageError(f"an OSC message has {len(message) - offset} bytes after its last argument")
    return tuple(arguments)


def time_tag_to_s(time_tag: int) -> float:
    """The seconds since 1970 of an NTP time tag."""
    return (time_tag >> 32) - NTP_TO_UNIX_S + (time_tag & 0xFFFFFFFF) / 2**32


def _text_end(message: bytes, offset: int, what: str) -> tuple[int, int]:
    """Where the text at `offset` ends, and where the next item begins after the zeros that pad the text."""
    end = message.find(b"\0", offset)
    after = (end & ~3) + 4
    if end < 0 or after > len(message) or message[end:after].strip(b"\0"):
        raise MessageError(f"an OSC {what} does not end with one to four zero bytes")
    return end, after


def _decode(text: bytes, what: str) -> str:
    try:
        return text.decode("utf-8")
    except UnicodeDecodeError:
        raise MessageError(f"an OSC {what} is not UTF-8 text") from None


def _read_blob(message: bytes, offset: int) -> tuple[bytes, int]:
    size = int.from_bytes(message[offset : offset + 4], "big", signed=True)
    start = offset + 4
    after = start + (size + 3 & ~3)
    if start > len(message) or size < 0 or after > len(message):
        raise MessageError(f"an OSC blob has the size {size}, but {max(len(message) - start, 0)} bytes are left")
    return message[start : start + size], after
