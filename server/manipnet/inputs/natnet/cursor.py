"""A position in a NatNet payload, which stays within the payload whatever the payload says."""

import struct
from collections.abc import Iterable
from typing import Final

from manipnet.wire.bodies import MessageError

MAX_PARTS: Final = 1_024
"""Parts of variable length that one packet may have, so that no packet takes long to read."""


_INT32: Final = struct.Struct("<i")
_HEAD: Final = struct.Struct("<ii")


class Cursor:
    """A position in one payload. It stays within the payload and limits the number of parts."""

    def __init__(self, payload: bytes) -> None:
        self._data, self._size = payload, len(payload)
        self._offset = 0
        self._parts = 0

    def skip(self, size: int) -> None:
        if size > self._size - self._offset:
            raise self._too_short(size)
        self._offset += size

    def part(self) -> None:
        self._parts += 1
        if self._parts > MAX_PARTS:
            raise MessageError(f"a NatNet payload has more than {MAX_PARTS} parts")

    def unpack(self, layout: struct.Struct) -> tuple:
        try:
            values = layout.unpack_from(self._data, self._offset)
        except struct.error:
            raise self._too_short(layout.size) from None
        self._offset += layout.size
        return values

    def rows(self, layout: struct.Struct, count: int, extra: int = 0) -> Iterable[tuple]:
        """The values of `count` structures in a row, each of which is followed by `extra` bytes."""
        start, size = self._offset, layout.size + extra
        self.skip(count * size)
        if not extra:
            return layout.iter_unpack(self._data[start : self._offset])
        return [layout.unpack_from(self._data, start + i * size) for i in range(count)]

    def int32(self) -> int:
        return self.unpack(_INT32)[0]

    def count(self) -> int:
        (count,) = self.unpack(_INT32)
        if not 0 <= count <= self._size:
            raise self._too_many(count)
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
        return self.cut(self._checked_size(self.int32()))

    def cut(self, size: int) -> "Cursor":
        """A cursor over the next `size` bytes. This cursor moves behind them."""
        start = self._offset
        self.skip(size)
        return Cursor(self._data[start : self._offset])

    def head(self) -> tuple[int, int]:
        """The number of elements in the section that comes next, and its size in bytes."""
        count, size = self.unpack(_HEAD)
        if not 0 <= count <= self._size:
            raise self._too_many(count)
        return count, self._checked_size(size)

    def skip_section(self) -> int:
        """Move behind the section that comes next, and return the number of its elements."""
        count, size = self.head()
        self._offset += size
        return count

    def _checked_size(self, size: int) -> int:
        if not 0 <= size <= self._size - self._offset:
            raise MessageError(f"a NatNet section announces {size} bytes, but {self.left()} are left")
        return size

    def _too_short(self, size: int) -> MessageError:
        return MessageError(f"a NatNet payload ends at byte {self._size}, where {size} more are needed")

    def _too_many(self, count: int) -> MessageError:
        return MessageError(f"a NatNet payload of {self._size} bytes announces {count} elements")
