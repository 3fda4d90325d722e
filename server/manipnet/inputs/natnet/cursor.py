"""A position in a NatNet payload, which stays within the payload whatever the payload says."""

import struct
from typing import Final

from manipnet.wire.bodies import MessageError

MAX_PARTS: Final = 1_024
"""Parts of variable length that one packet may have, so that no packet takes long to read."""


class Cursor:
    """A position in one payload. It stays within the payload and limits the number of parts."""

    def __init__(self, payload: bytes) -> None:
        self._data = payload
        self._offset = 0
        self._parts = 0

    def skip(self, size: int) -> None:
        if size > self.left():
            raise MessageError(f"a NatNet payload ends at byte {len(self._data)}, where {size} more are needed")
        self._offset += size

    def part(self) -> None:
        self._parts += 1
        if self._parts > MAX_PARTS:
            raise MessageError(f"a NatNet payload has more than {MAX_PARTS} parts")

    def unpack(self, layout: struct.Struct) -> tuple:
        start = self._offset
        self.skip(layout.size)
        return layout.unpack_from(self._data, start)

    def int32(self) -> int:
        start = self._offset
        self.skip(4)
        return int.from_bytes(self._data[start : start + 4], "little", signed=True)

    def count(self) -> int:
        count = self.int32()
        if not 0 <= count <= len(self._data):
            raise MessageError(f"a NatNet payload of {len(self._data)} bytes announces {count} elements")
        return count

    def text(self) -> bytes:
        start = self._offset
        end = self._data.find(b"\0", start)
        if end < 0:
            raise MessageError(f"a NatNet text at byte {start} has no end")
        self._offset = end + 1
        return self._data[start:end]

    def left(self) -> int:
        return len(self._data) - self._offset

    def section(self) -> "Cursor":
        """A cursor over the section whose byte size comes next. This cursor moves behind the section."""
        size = self.int32()
        if not 0 <= size <= self.left():
            raise MessageError(f"a NatNet section announces {size} bytes, but {self.left()} are left")
        start = self._offset
        self.skip(size)
        return Cursor(self._data[start : start + size])
