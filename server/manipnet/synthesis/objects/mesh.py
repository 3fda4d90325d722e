"""Meshes of objects: read in metres, closed and turned outward, or refused with the reason and the remedy.

What reads and repairs them is imported only when it is needed: `mesh_cache` has the meshes that were read before.
"""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from manipnet.synthesis.objects.foreign import foreign_format
from manipnet.synthesis.objects.glb import read_glb
from manipnet.synthesis.objects.glb_accessors import GlbError
from manipnet.synthesis.objects.units import UNITS_M, plausible_units

FORMATS: Final = (".obj", ".ply", ".stl", ".glb")
MAX_FACES: Final = 300_000
MAX_FILE_BYTES: Final = 200_000_000
SIZE_RANGE_M: Final = (0.005, 3.0)


class MeshError(ValueError):
    """A mesh cannot be used as an object; the text says what is wrong, where, and what to do about it."""


@dataclass(frozen=True, eq=False)
class ClosedMesh:
    """A watertight triangle mesh in metres: `vertices (V, 3)`, and `faces (F, 3)` int32, turned outward.

    `content_hash` identifies the geometry, independently of its file.
    """

    name: str
    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    content_hash: str


def load_mesh(path: Path | str, unit: str = "m", scale: float = 1.0, name: str | None = None) -> ClosedMesh:
    """Read an OBJ, PLY, STL or GLB file in `unit` and close the mesh; `scale` resizes it about its origin.

    Raises `MeshError`, whose text starts with the path.
    """
    path = Path(path)
    try:
        if unit not in UNITS_M:
            raise MeshError(f"unit {unit!r} is unknown; allowed are {', '.join(UNITS_M)}")
        if not (np.isfinite(scale) and 1e-3 <= scale <= 1e3):
            raise MeshError(f"scale is {scale}; allowed are 0.001 to 1000")
        vertices, faces = _read(path)
        return closed_mesh(vertices * (UNITS_M[unit] * scale), faces, name or path.stem)
    except MeshError as error:
        raise MeshError(f"{path}: {error}") from None


def closed_mesh(vertices: NDArray, faces: NDArray, name: str) -> ClosedMesh:
    """Check and repair a triangle mesh in metres. Raises `MeshError` if it cannot be closed.

    Repairs do not change the shape: vertices at the same place are merged, repeated faces and debris are dropped, small
    holes are closed, and each shell is turned outward, or inward if it is the wall of a cavity. A mesh that needs none
    of this keeps its arrays.
    """
    from manipnet.synthesis.objects.repair import agree, drop_debris, fill_small_holes, is_closed, orient, weld

    vertices, faces = np.array(vertices, dtype=np.float64), np.array(faces, dtype=np.int32)
    _check_arrays(vertices, faces)
    _check_size(vertices[np.unique(faces)])
    if not is_closed(faces):
        vertices, faces = weld(vertices, faces)
    if not is_closed(faces):
        vertices, faces = fill_small_holes(vertices, agree(faces))
        vertices, faces = drop_debris(vertices, agree(faces))
    if is_closed(faces):
        faces = orient(vertices, faces)
    _check_closed(vertices, faces)
    digest = hashlib.sha256(vertices.astype("<f8").tobytes() + faces.astype("<i4").tobytes()).hexdigest()
    return ClosedMesh(name, vertices, faces, digest)


def _read(path: Path) -> tuple[NDArray, NDArray]:
    if (reason := foreign_format(path)) is not None:
        raise MeshError(reason)
    if path.suffix.lower() not in FORMATS:
        raise MeshError(f"the format {path.suffix!r} is unknown; allowed are {', '.join(FORMATS)}")
    if not path.is_file():
        raise MeshError("no such file")
    if path.stat().st_size > MAX_FILE_BYTES:
        raise MeshError(f"the file is larger than {MAX_FILE_BYTES // 1_000_000} MB; reduce the mesh first")
    try:
        return _arrays(path)
    except GlbError as error:
        raise MeshError(str(error)) from None
    except MeshError:
        raise
    except Exception as error:  # readers of foreign formats raise exceptions of any kind
        reason = f"{type(error).__name__}: {error}"
        raise MeshError(f"cannot be read as {path.suffix[1:].upper()} ({reason}); export it again") from None


def _arrays(path: Path) -> tuple[NDArray, NDArray]:
    """Vertices and triangles as they are in the file."""
    if path.suffix.lower() == ".glb":
        return read_glb(path.read_bytes())
    import trimesh

    options = {"skip_materials": True} if path.suffix.lower() == ".obj" else {}
    mesh = trimesh.load_mesh(path, process=False, **options)
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise MeshError("holds no triangles; export the surface, not points, curves or an empty scene")
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def _check_arrays(vertices: NDArray, faces: NDArray) -> None:
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3 or not len(faces):
        raise MeshError(f"has vertices {vertices.shape} and faces {faces.shape}; expected are (V, 3) and (F, 3)")
    if not np.isfinite(vertices).all():
        bad = int(np.argwhere(~np.isfinite(vertices))[0, 0])
        raise MeshError(f"vertex {bad} is not finite: {vertices[bad]}; export the mesh again")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise MeshError(f"has a face with vertex {faces.max()}; allowed are 0 to {len(vertices) - 1}")
    if len(faces) > MAX_FACES:
        raise MeshError(
            f"has {len(faces)} triangles; at most {MAX_FACES} are allowed; decimate it (5,000 suffice for most shapes)"
        )


def _check_size(vertices: NDArray) -> None:
    smallest, largest = SIZE_RANGE_M
    size = float(np.ptp(vertices, axis=0).max())
    if smallest <= size <= largest:
        return
    if size == 0.0:
        raise MeshError("has all its vertices at one place; export the surface again")
    fitting = plausible_units(size)
    remedy = f"if the file is in {' or '.join(fitting)}, set its unit" if fitting else "set its unit or scale"
    raise MeshError(f"is {size:.3g} m across; allowed are {smallest} to {largest} m; {remedy}")


def _check_closed(vertices: NDArray, faces: NDArray) -> None:
    from manipnet.synthesis.objects.repair import mesh_edges, signed_volume

    if not len(faces):
        raise MeshError("has no triangle with an area; export the surface again")
    edges = mesh_edges(faces)
    open_edges, crowded = edges.ends[edges.uses == 1], edges.ends[edges.uses > 2]
    if len(open_edges):
        points = vertices[open_edges.reshape(-1)]
        raise MeshError(
            f"is not closed: {len(open_edges)} open edges around {_place(points)}, which span "
            f"{100 * np.ptp(points, axis=0).max():.1f} cm. A sheet has no inside: give it a thickness "
            "(Blender: Solidify) or close it (Blender: Mesh > Clean Up > Fill Holes)"
        )
    if len(crowded):
        raise MeshError(
            f"is not a surface: {len(crowded)} edges have more than two faces, around "
            f"{_place(vertices[crowded.reshape(-1)])}; remove inner walls (Blender: 3D-Print > Make Manifold)"
        )
    size = float(np.ptp(vertices, axis=0).max())
    if signed_volume(vertices, faces) < 1e-5 * size**3:
        raise MeshError("encloses no volume: it is flat, or parts of it are inside out; give it a thickness")


def _place(points: NDArray) -> str:
    x, y, z = points.mean(axis=0)
    return f"({x:.3f}, {y:.3f}, {z:.3f}) m"
