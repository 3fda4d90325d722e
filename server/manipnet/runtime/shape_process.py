"""Meshes that were never read before are prepared in a child process.

Reading and repairing one holds the GIL for tenths of a second, in which no tick could run, and so does importing what
does it. The child returns the mesh, and leaves it and its shape in the cache.
"""

import io
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from manipnet.runtime.child_process import ChildProcess
from manipnet.synthesis.objects.mesh import ClosedMesh, MeshError
from manipnet.synthesis.objects.shape import Shape, build_shape, cached_mesh, load_shape


def make_shape(path: Path, unit: str, scale: float) -> Shape:
    """The shape of a mesh file, as `load_shape` makes it, without a delay of the ticks. Raises `MeshError`."""
    return build_shape(cached_mesh(path, unit, scale) or _prepared(path, unit, scale))


def _prepared(path: Path, unit: str, scale: float) -> ClosedMesh:
    child = ChildProcess("shape", _prepare, path, unit, scale)
    try:
        answer = child.connection.recv_bytes()
    except EOFError:
        raise MeshError(
            f"{path}: the process that read it ended without a result; is the mesh too large for this machine's memory?"
        ) from None
    finally:
        child.close()
    with np.load(io.BytesIO(answer), allow_pickle=False) as mesh:
        if "refused" in mesh:
            raise MeshError(str(mesh["refused"]))
        return ClosedMesh(str(mesh["name"]), mesh["vertices"], mesh["faces"], str(mesh["content_hash"]))


def _prepare(connection: Connection, path: Path, unit: str, scale: float) -> None:
    """The child: builds the shape, which puts it into the cache, and sends the mesh or why it was refused."""
    answer = io.BytesIO()
    try:
        mesh = load_shape(path, unit, scale).mesh
        np.savez(answer, name=mesh.name, vertices=mesh.vertices, faces=mesh.faces, content_hash=mesh.content_hash)
    except MeshError as error:
        np.savez(answer, refused=str(error))
    connection.send_bytes(answer.getvalue())
