"""Closed meshes by the content of the files that they were read from.

A server that finds its meshes here needs neither what reads mesh files nor what repairs meshes, which takes 40 MB and
more than half a second to import.
"""

import hashlib
from pathlib import Path
from typing import Final

import numpy as np

from manipnet.synthesis.objects.mesh import MAX_FILE_BYTES, ClosedMesh
from manipnet.synthesis.objects.shape_cache import read_arrays, write_arrays

_VERSION: Final = 1
"""Rises when a file may be read or repaired in another way."""


def mesh_cache_name(path: Path, unit: str, scale: float) -> str | None:
    """The name of the cached mesh of a file in `unit`, resized by `scale`; None if the file cannot be read."""
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            return None
        content = path.read_bytes()
    except OSError:
        return None
    read_as = f"{_VERSION} {path.suffix.lower()} {unit} {float(scale)!r} ".encode()
    return f"mesh-{hashlib.sha256(read_as + content).hexdigest()[:32]}.npz"


def read_cached_mesh(path: Path, name: str) -> ClosedMesh | None:
    """The mesh in a cache file, under a `name`; None if there is no file or it cannot be read."""
    arrays = read_arrays(path, ("vertices", "faces", "content_hash"))
    return None if arrays is None else ClosedMesh(name, arrays[0], arrays[1], str(arrays[2]))


def write_cached_mesh(path: Path, mesh: ClosedMesh) -> None:
    """Write a mesh to a cache file, or log why that is not possible."""
    write_arrays(path, vertices=mesh.vertices, faces=mesh.faces, content_hash=np.array(mesh.content_hash))
