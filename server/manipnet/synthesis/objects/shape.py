"""Shapes: what the hands sense of objects, built once from a closed mesh and cached on disk by its content."""

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from platformdirs import user_cache_dir

from manipnet.geometry import Array
from manipnet.jit import kernel
from manipnet.synthesis.objects.bvh import Bvh, build_bvh
from manipnet.synthesis.objects.distance_field import (
    EXACT_WITHIN_CELLS,
    RESOLUTION,
    Field,
    build_field,
    signed_distance,
)
from manipnet.synthesis.objects.library import library_file
from manipnet.synthesis.objects.mass import mass_of
from manipnet.synthesis.objects.mesh import ClosedMesh, load_mesh
from manipnet.synthesis.objects.mesh_cache import mesh_cache_name, read_cached_mesh, write_cached_mesh
from manipnet.synthesis.objects.rays import RayScene, ray_scene
from manipnet.synthesis.objects.shape_cache import read_cached, write_cached
from manipnet.synthesis.objects.simplify import FEWER_TRIANGLES, MOST_TRIANGLES, simplified

_CACHE_VERSION = f"1-{RESOLUTION}"
PREBUILT_FOLDER = Path(__file__).with_name("prebuilt")
"""The shapes of the demo's objects, so that a first start need not compile the code that builds them, and the closed
meshes of the library."""


class Solid(NamedTuple):
    """A shape as an argument of kernels."""

    bvh: Bvh
    field: Field
    exact_within_m: float
    """The sensors compute distances below this, in the object's own metres, exactly instead of from the field."""
    center_of_mass: Array


@dataclass(frozen=True, eq=False)
class Shape:
    """The geometry of an object in its own frame, metres, at scale 1, with the queries of sensors and solvers."""

    mesh: ClosedMesh
    bvh: Bvh
    """The tree over the mesh, or over a reduced mesh that is nearly the same (`simplify`)."""
    field: Field
    center_of_mass: Array
    """`(3,)`, for uniform density."""
    volume_m3: float
    inertia: Array
    """`(3, 3)` about the centre of mass for a total mass of 1 kg."""

    @property
    def name(self) -> str:
        """The name of the mesh."""
        return self.mesh.name

    @property
    def content_hash(self) -> str:
        """The hash of the geometry."""
        return self.mesh.content_hash

    @property
    def bounds(self) -> Array:
        """Lower and upper corner, `(2, 3)`."""
        return self.bvh.boxes[0].reshape(2, 3)

    @cached_property
    def reach_m(self) -> float:
        """Upper bound of the distance from the origin of its frame to any of its points, metres at scale 1."""
        return float(np.linalg.norm(np.abs(self.bounds).max(axis=0)))

    @cached_property
    def distance_at_origin_m(self) -> float:
        """Signed distance of the origin of its frame, metres at scale 1."""
        return self.distance((0.0, 0.0, 0.0))

    @cached_property
    def solid(self) -> Solid:
        """The shape as an argument of kernels."""
        return Solid(self.bvh, self.field, EXACT_WITHIN_CELLS * self.field.cell_m, self.center_of_mass)

    @cached_property
    def rays(self) -> RayScene:
        """The ray scene, which is made on first use."""
        return ray_scene(self.bvh)

    def distance(self, p_object: tuple[float, float, float]) -> float:
        """Exact signed distance of one point in the object's frame."""
        return _distance(self.solid, *p_object)

    def signed_distance(self, points: Array) -> tuple[Array, Array, Array]:
        """Exact distances of `points (N, 3)` in the object's frame.

        Returns signed distances `(N,)`, negative inside, unit directions away from the surface `(N, 3)`, and the
        closest points of the surface `(N, 3)`.
        """
        points = np.ascontiguousarray(points, dtype=np.float64)
        distance, normal = np.empty(len(points)), np.empty((len(points), 3))
        _signed_distances(self.bvh, self.field, points, np.inf, distance, normal)
        return distance, normal, points - distance[:, None] * normal

    def trace(self, origins: Array, directions: Array) -> Array:
        """Distance `(N,)` along unit `directions (N, 3)` to the first hit, `inf` without a hit."""
        return self.rays.trace(origins, directions)[0]


@kernel
def _distance(solid: Solid, x: float, y: float, z: float):
    return signed_distance(solid.bvh, solid.field, x, y, z, np.inf)[0]


@kernel
def _signed_distances(bvh: Bvh, field: Field, points: Array, exact_within_m: float, distance: Array, normal: Array):
    for i in range(len(points)):
        d, x, y, z = signed_distance(bvh, field, points[i, 0], points[i, 1], points[i, 2], exact_within_m)
        distance[i], normal[i, 0], normal[i, 1], normal[i, 2] = d, x, y, z


def load_shape(mesh: Path | str, unit: str = "m", scale: float = 1.0, name: str | None = None) -> Shape:
    """Build the shape of a mesh file in `unit`, or of the library object of that name.

    Raises `MeshError` as `load_mesh` does.
    """
    if not Path(mesh).is_file() and (file := library_file(str(mesh))) is not None:
        mesh, unit = file, "m"
    path = Path(mesh)
    known = cached_mesh(path, unit, scale, name)
    if known is None:
        known = load_mesh(path, unit, scale, name)
        if (file_name := mesh_cache_name(path, unit, scale)) is not None:
            write_cached_mesh(_cache_folder() / file_name, known)
    return build_shape(known)


def cached_mesh(path: Path, unit: str = "m", scale: float = 1.0, name: str | None = None) -> ClosedMesh | None:
    """The closed mesh of a file that was read before with the same content, unit and scale, from the cache."""
    file_name = mesh_cache_name(path, unit, scale)
    if file_name is None:
        return None
    found = (read_cached_mesh(folder / file_name, name or path.stem) for folder in (_cache_folder(), PREBUILT_FOLDER))
    return next((mesh for mesh in found if mesh is not None), None)


def build_shape(mesh: ClosedMesh, cache_dir: Path | None = None) -> Shape:
    """Build a shape, or read it from the cache folder: `cache_dir`, else `MANIPNET_CACHE`, else the user's."""
    path = (cache_dir or _cache_folder()) / cache_name(mesh)
    parts = read_cached(path) or read_cached(PREBUILT_FOLDER / path.name)
    if parts is None:
        sensed = simplified(mesh)
        bvh = build_bvh(sensed.vertices, sensed.faces)
        parts = bvh, build_field(bvh)
        write_cached(path, *parts)
    return Shape(mesh, *parts, *mass_of(mesh.vertices, mesh.faces))


def _cache_folder() -> Path:
    return Path(os.environ.get("MANIPNET_CACHE") or user_cache_dir("manipnet", appauthor=False))


def cache_name(mesh: ClosedMesh) -> str:
    """The name of the file with a mesh's shape in a cache folder."""
    fewer = f"-{FEWER_TRIANGLES}" if len(mesh.faces) > MOST_TRIANGLES else ""
    return f"{mesh.content_hash[:32]}-{_CACHE_VERSION}{fewer}.npz"
