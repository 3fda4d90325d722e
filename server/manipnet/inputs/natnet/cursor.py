"""A position in a NatNet payload, which stays within the payload whatever the payload says."""

import struct
from collections.abc import Iterable
from typing import Final

from manipnet.wire.bodies import MessageError

MAX_PARTS: Final = 1_024
"""Parts of variable length that one packet may have, so that no packet takes long to read."""


class Cursor:
    """A position in one payload. It stays within the payload and limits the number of parts."""

    def __init__(self, payload: bytes) -> None:
        self._data, self._size = payload, len(payload)
        self._offset = 0
        self._parts = 0

    def skip(self, size: int) -> None:
        if size > self._size - self._offset:
            raise MessageError(f"a NatNet payload ends at byte {self._size}, where {size} more are needed")
        self._offset += size

    def part(self) -> None:
        self._parts += 1
        if self._parts > MAX_PARTS:
            raise MessageError(f"a NatNet payload has more than {MAX_PARTS} parts")

    def unpack(self, layout: struct.Struct) -> tuple:
        start = self._offset
        self.skip(layout.size)
        return layout.unpack_from(self._data, start)

    def rows(self, layout: struct.Struct, count: int, extra: int = 0) -> Iterable[tuple]:
        """The values of `count` structures in a row, each of which is followed by `extra` bytes."""
        start, size = self._offset, layout.size + extra
        self.skip(count * size)
        if not extra:
            return layout.iter_unpack(self._data[start : self._offset])
        return [layout.unpack_from(self._data, start + i * size) for i in range(count)]

    def int32(self) -> int:
        start = self._offset
        end = self._offset = start + 4
        if end > self._size:
            self._offset = start
            self.skip(4)
        return int.from_bytes(self._data[start:end], "little", signed=True)

    def count(self) -> int:
        count = self.int32()
        if not 0 <= count <= self._size:
            raise MessageError(f"a NatNet payload of {self._size} bytes announces {count} elements")
        return count

    def text(self) -> bytes:
        start = self._offset
        end = self._data.find(b"\0", start)
        if end < 0:
            raise MessageError(f"a NatNet text at byte {start} has no end")
        self._offset = end + 1
        return self._data[start:end]

    def left(self) -> int:
        return self._size - self._offset

    def section(self) -> "Cursor":
        """A cursor over the section whose byte size comes next. This cursor moves behind the section."""
        start = self._offset + 4
        self.skip_section()
        return Cursor(self._data[start : self._offset])

    def skip_section(self) -> None:
        """Move behind the section whose byte size comes next."""
        size = self.int32()
        if not 0 <= size <= self._size - self._offset:
            raise MessageError(f"a NatNet section announces {size} bytes, but {self.left()} are left")
        self._offset += size
