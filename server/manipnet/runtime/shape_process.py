"""Large meshes are prepared in a process of their own: reading and mending one keeps Python to itself for tenths of a
second, in which no tick could run. What comes back is a mesh whose shape is in the cache."""

import io
import multiprocessing
import signal
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final

import numpy as np

from manipnet.synthesis.objects.mesh import ClosedMesh, MeshError
from manipnet.synthesis.objects.shape import Shape, build_shape, load_shape

LARGE_BYTES: Final = 1_000_000
"""Of a file: some 20,000 triangles. A smaller one is read before another process would have begun."""


def make_shape(path: Path, unit: str, scale: float) -> Shape:
    """The shape of a mesh file, as `load_shape` makes it; on any thread beside the ticks. Raises `MeshError`."""
    try:
        large = path.stat().st_size >= LARGE_BYTES
    except OSError:
        large = False  # whoever reads it says why
    return build_shape(_prepared(path, unit, scale)) if large else load_shape(path, unit, scale)


def _prepared(path: Path, unit: str, scale: float) -> ClosedMesh:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_prepare, args=(theirs, path, unit, scale), name="workshop", daemon=True)
    process.start()
    theirs.close()
    try:
        told = ours.recv_bytes()
    except EOFError:
        raise MeshError(f"{path}: the process that read it died; is it too large for this machine's memory?") from None
    finally:
        ours.close()
        process.join()
    with np.load(io.BytesIO(told), allow_pickle=False) as mesh:
        if "refused" in mesh:
            raise MeshError(str(mesh["refused"]))
        return ClosedMesh(str(mesh["name"]), mesh["vertices"], mesh["faces"], str(mesh["content_hash"]))


def _prepare(connection: Connection, path: Path, unit: str, scale: float) -> None:
    """The process: builds the shape, which leaves it in the cache, and tells the mesh or why there is none."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a Ctrl-C is for the server
    told = io.BytesIO()
    try:
        mesh = load_shape(path, unit, scale).mesh
        np.savez(told, name=mesh.name, vertices=mesh.vertices, faces=mesh.faces, content_hash=mesh.content_hash)
    except MeshError as error:
        np.savez(told, refused=str(error))
    connection.send_bytes(told.getvalue())
