"""Writes glTF Binary files of a box for tests, in the encodings that exporters use."""

import json
import struct
from typing import Any

import numpy as np

_SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
FACES = np.array([corner for a, b, c, d in _SIDES for corner in ((a, b, c), (a, c, d))])
"""Triangles of a box, which face outward."""
KINDS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


def box(x: float, y: float, z: float, at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """The corners `(8, 3)` of a box with these half sizes."""
    return np.array([[i, j, k] for i in (-x, x) for j in (-y, y) for k in (-z, z)]) + at


class Glb:
    """A document that grows array by array. `document` may be changed before `bytes` is called."""

    def __init__(self) -> None:
        self._data = b""
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [{"attributes": {}}]}],
            "accessors": [],
            "bufferViews": [],
        }

    @property
    def primitive(self) -> dict[str, Any]:
        return self.document["meshes"][0]["primitives"][0]

    def view(self, data: bytes, **entries: Any) -> int:
        """Append a buffer view; returns its number."""
        self._data += b"\0" * (-len(self._data) % 4)
        view = {"buffer": 0, "byteOffset": len(self._data), "byteLength": len(data), **entries}
        self.document["bufferViews"].append(view)
        self._data += data
        return len(self.document["bufferViews"]) - 1

    def array(self, values: np.ndarray, kind: str = "f4", stride: int | None = None, **entries: Any) -> int:
        """Append an accessor with values `(N, width)` of a component type; returns its number."""
        rows = np.ascontiguousarray(values.reshape(len(values), -1), f"<{kind}")
        data = rows.tobytes()
        if stride is not None:
            padded = np.zeros((len(rows), stride), np.uint8)
            padded[:, : rows.itemsize * rows.shape[1]] = rows.view(np.uint8)
            data = padded.tobytes()
        view = self.view(data, **({} if stride is None else {"byteStride": stride}))
        self.document["accessors"].append(
            {
                "bufferView": view,
                "componentType": KINDS[kind],
                "count": len(rows),
                "type": TYPES[rows.shape[1]],
                **entries,
            }
        )
        return len(self.document["accessors"]) - 1

    def bytes(self) -> bytes:
        """The file."""
        data = self._data + b"\0" * (-len(self._data) % 4)
        self.document.setdefault("buffers", [{"byteLength": len(data)}])
        return pack(self.document, data)


def pack(document: dict[str, Any], data: bytes) -> bytes:
    """A file of a document and its binary chunk."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def box_glb(points: np.ndarray, kind: str = "f4", **entries: Any) -> Glb:
    """A file with one box, whose corners are stored as they are given."""
    glb = Glb()
    glb.primitive["attributes"]["POSITION"] = glb.array(points, kind, **entries)
    glb.primitive["indices"] = glb.array(FACES.reshape(-1, 1), "u2")
    return glb
