"""Writes the skeleton of a rig as a glTF Binary file without a skin."""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np


def write_glb(path: Path, nodes: list[tuple[str, int, np.ndarray]], **more: Any) -> Path:
    """Write `nodes`: name, parent and place in the world of each bone. `more` is added to the document."""
    children = {n: [k for k, (_, parent, _) in enumerate(nodes) if parent == n] for n in range(len(nodes))}
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {
                "name": name,
                "translation": (place - (nodes[parent][2] if parent >= 0 else 0.0)).tolist(),
                **({"children": children[n]} if children[n] else {}),
            }
            for n, (name, parent, place) in enumerate(nodes)
        ],
        **more,
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    path.write_bytes(b"glTF" + struct.pack("<2I", 2, 20 + len(text)) + struct.pack("<I4s", len(text), b"JSON") + text)
    return path
