"""Writes the container of glTF 2.0: accessors in one buffer, and the file that holds them.

Source: Khronos, glTF 2.0 specification, sections 3.6 (accessors) and 4.4 (GLB). A library would save only forty lines.
"""

import base64
import json
import struct
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

ATTRIBUTE: Final = 34962
INDEX: Final = 34963
_COMPONENTS: Final = {np.dtype(np.uint8): 5121, np.dtype(np.uint16): 5123, np.dtype(np.uint32): 5125} | {
    np.dtype(np.float32): 5126
}
_TYPES: Final = {(): "SCALAR", (2,): "VEC2", (3,): "VEC3", (4,): "VEC4", (4, 4): "MAT4"}


class Buffer:
    """Arrays that are packed one after the other, each with its buffer view and its accessor."""

    def __init__(self, document: dict[str, Any] | None = None, content: bytes = b"") -> None:
        """An empty buffer, or the first one of a document, whose arrays keep their places."""
        document = document or {}
        self._bytes = bytearray(content + bytes(-len(content) % 4))
        self._views: list[dict[str, Any]] = list(document.get("bufferViews", []))
        self._accessors: list[dict[str, Any]] = list(document.get("accessors", []))
        self._others: list[dict[str, Any]] = list(document.get("buffers", []))[1:]

    def add(self, values: NDArray[Any], target: int | None = None, bounds: bool = False) -> int:
        """Append an array, and return the index of its accessor.

        The values are unsigned integers or float32, `(n,)`, `(n, k)` or matrices `(n, 4, 4)`. `target` is the purpose
        of the buffer view, if it has one; `bounds` adds the smallest and largest values to the accessor.
        """
        kind = _TYPES[values.shape[1:]]
        flat = np.swapaxes(values, 1, 2) if kind == "MAT4" else values  # glTF stores matrices by column
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self._bytes), "byteLength": values.nbytes}
        self._views.append(view | ({"target": target} if target else {}))
        accessor = {"bufferView": len(self._views) - 1, "componentType": _COMPONENTS[values.dtype]}
        accessor |= {"count": len(values), "type": kind}
        if bounds:
            rows = values.reshape(len(values), -1)
            accessor |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        self._accessors.append(accessor)
        self._bytes += np.ascontiguousarray(flat).tobytes()
        self._bytes += bytes(-len(self._bytes) % 4)
        return len(self._accessors) - 1

    def save(self, path: Path, document: dict[str, Any]) -> None:
        """Write `document` with this buffer: `.glb` in one binary file, `.gltf` as JSON with the buffer inside it."""
        content = bytes(self._bytes)
        buffer: dict[str, Any] = {"byteLength": len(content)}
        if path.suffix.lower() == ".gltf":
            buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(content).decode()
        document = document | {
            "accessors": self._accessors,
            "bufferViews": self._views,
            "buffers": [buffer, *self._others],
        }
        text = json.dumps(document, separators=(",", ":"), ensure_ascii=False).encode()
        path.write_bytes(text if "uri" in buffer else _glb(text, content))


def _glb(text: bytes, content: bytes) -> bytes:
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(content), b"BIN\0") + content
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
