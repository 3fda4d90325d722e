"""Reads the arrays of a glTF file: of every component type, normalised, interleaved and sparse."""

import base64
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

COMPONENTS: Final = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS: Final = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
MAX_ELEMENTS: Final = 2_000_000


class GlbError(ValueError):
    """A glTF Binary file cannot be read; the text says what is wrong and what to do about it."""


def check_size(elements: int) -> None:
    """Raise `GlbError` for more vertices than any mesh that is allowed has."""
    if elements > MAX_ELEMENTS:
        raise GlbError(f"has {elements} vertices; decimate the mesh first")


class Accessors:
    """The buffers of a document, and the arrays in them."""

    def __init__(self, document: dict[str, Any], binary: bytes) -> None:
        self._accessors: list[dict[str, Any]] = document.get("accessors", [])
        self._views: list[dict[str, Any]] = document.get("bufferViews", [])
        self._buffers: list[dict[str, Any]] = document.get("buffers", [])
        self._binary = binary

    def has_data(self, accessor: int) -> bool:
        """Whether an array has values in the file."""
        return "bufferView" in self._accessors[accessor]

    def read(self, accessor: int, width: int) -> NDArray[np.float64]:
        """An array `(N, width)`. Raises `GlbError`."""
        entry = self._accessors[accessor]
        count, kind = entry["count"], entry["componentType"]
        if WIDTHS.get(entry["type"]) != width or kind not in COMPONENTS or not isinstance(count, int) or count < 0:
            found = f"{entry['type']} of {kind}, {count!r} of them"
            raise GlbError(f"is a damaged glTF file (accessor {accessor} is {found}); export it again")
        check_size(count * width // 3)
        values = np.zeros((count, width))
        if "bufferView" in entry:
            values[:] = self._elements(entry["bufferView"], entry.get("byteOffset", 0), kind, width, count)
        if (sparse := entry.get("sparse")) is not None:
            changed, where, what = int(sparse["count"]), sparse["indices"], sparse["values"]
            check_size(changed)
            places = self._elements(where["bufferView"], where.get("byteOffset", 0), where["componentType"], 1, changed)
            values[places[:, 0]] = self._elements(what["bufferView"], what.get("byteOffset", 0), kind, width, changed)
        if entry.get("normalized", False) and kind not in (5125, 5126):
            values = np.maximum(values / np.iinfo(np.dtype(COMPONENTS[kind])).max, -1.0)
        return values

    def view(self, number: int) -> bytes:
        """The bytes of a buffer view. Raises `GlbError`."""
        view = self._views[number]
        buffer, start, length = self._buffer(view["buffer"]), int(view.get("byteOffset", 0)), int(view["byteLength"])
        if start < 0 or length < 0 or start + length > len(buffer):
            raise GlbError(
                f"is cut off: buffer view {number} ends at {start + length} of {len(buffer)} bytes; export it again"
            )
        return buffer[start : start + length]

    def _elements(self, view: int, start: int, kind: int, width: int, count: int) -> NDArray:
        """`(count, width)` values, which may be interleaved with others."""
        data, component = self.view(view), np.dtype(COMPONENTS[kind])
        size = component.itemsize * width
        stride = int(self._views[view].get("byteStride", size))
        if count and (start < 0 or stride < size or start + (count - 1) * stride + size > len(data)):
            raise GlbError(f"is cut off: {count} elements do not fit into buffer view {view}; export it again")
        if not count:
            return np.empty((0, width), component)
        return np.ndarray((count, width), component, data, start, (stride, component.itemsize))

    def _buffer(self, number: int) -> bytes:
        buffer = self._buffers[number]
        extensions = buffer.get("extensions", {})
        if compressed := [name for name in extensions if extensions[name].get("fallback")]:
            raise GlbError(f"is compressed with {compressed[0]}, which cannot be read; export it without compression")
        uri = buffer.get("uri")
        if uri is None:
            return self._binary
        head, comma, content = str(uri).partition(",")
        if not (head.startswith("data:") and comma):
            raise GlbError(f"keeps its data in another file, {uri}; export it as one glTF Binary (.glb)")
        return base64.b64decode(content) if head.endswith(";base64") else content.encode()
