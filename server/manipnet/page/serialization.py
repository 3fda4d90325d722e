"""Messages between the server and its page's process, as msgpack: reading one cannot run code."""

from dataclasses import fields
from typing import Any, Final

import msgpack
import numpy as np

from manipnet.page.frames import Frame, HandView, PropView, ShapeView
from manipnet.wire import HandsMessage, decode_msgpack, encode_msgpack

_ARRAY, _HANDS = 1, 2
_VIEWS: Final[dict[int, type]] = {3: PropView, 4: HandView, 5: Frame, 6: ShapeView}
"""Values that are sent as the tuple of their fields, by their msgpack extension type."""
_CODES: Final = {kind: code for code, kind in _VIEWS.items()}


def pack(what: str, content: Any) -> bytes:
    """Encode one message. Its content is anything that msgpack knows, a frame or a shape."""
    return _packed((what, content))


def unpack(payload: bytes) -> tuple[str, Any]:
    """Decode a message of `pack`; lists become tuples."""
    return _unpacked(payload)


def _packed(value: Any) -> bytes:
    return msgpack.packb(value, default=_extended)


def _unpacked(payload: bytes) -> Any:
    return msgpack.unpackb(payload, ext_hook=_restored, use_list=False)


def _extended(value: Any) -> msgpack.ExtType:
    if isinstance(value, np.ndarray):
        return msgpack.ExtType(_ARRAY, _packed((value.dtype.str, value.shape, value.tobytes())))
    if isinstance(value, HandsMessage):
        return msgpack.ExtType(_HANDS, encode_msgpack(value))
    if type(value) not in _CODES:
        raise TypeError(f"{type(value).__name__} cannot be sent to or from the page")
    return msgpack.ExtType(_CODES[type(value)], _packed([getattr(value, field.name) for field in fields(value)]))


def _restored(code: int, payload: bytes) -> Any:
    if code == _HANDS:
        return decode_msgpack(payload)
    content = _unpacked(payload)
    if code == _ARRAY:
        dtype, shape, values = content
        return np.frombuffer(values, dtype).reshape(shape).copy()  # kernels require writable arrays
    return _VIEWS[code](*content)
