"""Types of the part of msgpack that is used here; the library has none, and its `packb` is inferred as optional."""

from collections.abc import Callable
from typing import Any, NamedTuple

class ExtType(NamedTuple):
    code: int
    data: bytes

class UnpackException(Exception): ...  # noqa: N818 (the library calls it so)

def packb(o: Any, *, default: Callable[[Any], Any] | None = None) -> bytes: ...
def unpackb(
    packed: bytes | bytearray | memoryview,
    *,
    ext_hook: Callable[[int, bytes], Any] = ...,
    use_list: bool = True,
    strict_map_key: bool = True,
    max_array_len: int = -1,
    max_map_len: int = -1,
) -> Any: ...
