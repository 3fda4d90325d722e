"""A strict reader of Open Sound Control 1.0: it checks sizes, nesting, types and text before it uses them.

python-osc is not used to read datagrams from outside: its parser loops forever on a negative element size, runs out of
stack on deep nesting, raises decoding errors and treats `*` in an address as a regular expression.
"""

import struct
from collections.abc import Collection
from functools import lru_cache
from typing import NamedTuple

from manipnet.wire.bodies import MessageError
from manipnet.wire.text import read_text

MAX_DATAGRAM_BYTES = 24_576
MAX_MESSAGES = 256
MAX_DEPTH = 4
MAX_ADDRESS_BYTES = 256
MAX_ARGUMENTS = 64
IMMEDIATELY = 1
NTP_TO_UNIX_S = 2_208_988_800

Argument = int | float | str | bytes | bool | None

_BUNDLE = b"#bundle\0"
_SLASH = ord("/")
_SIZE = struct.Struct(">i")
_STRUCT_OF = {"i": "i", "f": "f", "h": "q", "d": "d", "t": "Q", "r": "I", "c": "I", "m": "I"}
_CONSTANTS: dict[str, Argument] = {"T": True, "F": False, "N": None, "I": True}
_NUMBERS = frozenset(b"ifhd")
_PATTERN = frozenset("*?[]{}")


class Packet(NamedTuple):
    """The messages of a datagram, each with its time tag, and what was wrong with the parts that were left out."""

    messages: list[tuple[int, bytes]]
    faults: list[str]


def split_packet(data: bytes) -> Packet:
    """Split a datagram into its messages, in order. A part that is wrong costs only itself.

    A message has the time tag of the innermost bundle around it whose tag is not "immediately". Raises `MessageError`
    if there is no message in the datagram.
    """
    if not 4 <= len(data) <= MAX_DATAGRAM_BYTES:
        raise MessageError(f"the datagram has {len(data)} bytes; 4 to {MAX_DATAGRAM_BYTES} are allowed")
    packet = Packet([], [])
    _split(data, IMMEDIATELY, 0, packet)
    if packet.faults and not packet.messages:
        raise MessageError(packet.faults[0])
    return packet


def _split(data: bytes, time_tag: int, depth: int, packet: Packet) -> None:
    if data[:1] == b"/" and len(data) % 4 == 0:
        packet.messages.append((time_tag, data))
    elif data[:8] != _BUNDLE and len(data) % 4:
        packet.faults.append(f"an OSC element has {len(data)} bytes; the length must be a multiple of 4")
    elif data[:8] != _BUNDLE or len(data) < 16:
        packet.faults.append(f"an OSC element begins with {data[:8]!r}; it must be '/', or '#bundle' and a time tag")
    elif depth == MAX_DEPTH:
        packet.faults.append(f"bundles are nested deeper than {MAX_DEPTH}")
    else:
        own_tag = int.from_bytes(data[8:16], "big")
        _split_bundle(data, time_tag if own_tag == IMMEDIATELY else own_tag, depth, packet)


def _split_bundle(data: bytes, time_tag: int, depth: int, packet: Packet) -> None:
    messages, faults = packet
    position, end = 16, len(data)
    while position < end:
        (size,) = _SIZE.unpack_from(data, position) if position + 4 <= end else (0,)
        position += 4
        if not 0 < size <= end - position:
            faults.append(f"a bundle element has the size {size}, but {max(end - position, 0)} bytes are left")
            return
        if len(messages) + len(faults) >= MAX_MESSAGES:
            faults.append(f"the bundle has more than {MAX_MESSAGES} messages")
            return
        element = data[position : position + size]
        if element[0] == _SLASH and not size & 3:
            messages.append((time_tag, element))
        else:
            _split(element, time_tag, depth + 1, packet)
        position += size


def read_address(message: bytes) -> tuple[bytes, int]:
    """The raw address, which `check_address` checks, and the offset of what follows it. Raises `MessageError`."""
    end, after = _text_end(message, 0, "address")
    return message[:end], after


def check_address(raw: bytes, expected: Collection[object] = ()) -> str:
    """The text of an address, if it is allowed; `expected` names help with other encodings. Raises `MessageError`."""
    address = "/".join(read_text(part, expected) for part in raw.split(b"/"))
    if len(raw) > MAX_ADDRESS_BYTES or not address.isprintable() or not _PATTERN.isdisjoint(address):
        allowed = f"at most {MAX_ADDRESS_BYTES} printable characters without any of * ? [ ] {{ }}"
        raise MessageError(f"the OSC address is {address[:40]!r}; it must have {allowed}")
    return address


def read_arguments(message: bytes, offset: int, expected: Collection[object] = ()) -> tuple[Argument, ...]:
    """The arguments from the offset that `read_address` returned. Raises `MessageError`.

    Text that is not UTF-8 is read in another encoding, if possible one that gives one of the `expected` names.
    """
    if offset == len(message):
        return ()  # old senders omit the type tags of a message without arguments
    end, after = _text_end(message, offset, "type tag string")
    return _read_any(message[offset:end].decode("latin-1"), message, after, expected)


def read_types(message: bytes, offset: int) -> bytes:
    """The type tags of the arguments that `read_arguments` has read from this offset."""
    return message[offset + 1 : max(message.find(b"\0", offset), offset + 1)]


@lru_cache(maxsize=64)
def numbers_layout(types: bytes) -> struct.Struct | None:
    """The layout of arguments of these types if they are all numbers, as poses are, or None for others."""
    if len(types) > MAX_ARGUMENTS or not _NUMBERS.issuperset(types):
        return None
    return struct.Struct(">" + "".join(_STRUCT_OF[type] for type in types.decode()))


def _read_any(tags: str, message: bytes, offset: int, expected: Collection[object]) -> tuple[Argument, ...]:
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
            arguments.append(read_text(message[offset:end], expected))
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


def _read_blob(message: bytes, offset: int) -> tuple[bytes, int]:
    size = int.from_bytes(message[offset : offset + 4], "big", signed=True)
    start = offset + 4
    after = start + (size + 3 & ~3)
    if start > len(message) or size < 0 or after > len(message):
        raise MessageError(f"an OSC blob has the size {size}, but {max(len(message) - start, 0)} bytes are left")
    return message[start : start + size], after
