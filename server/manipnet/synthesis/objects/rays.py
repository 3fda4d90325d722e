"""First hits of many rays on a mesh: by Embree where it has a wheel, elsewhere by our own tree, with equal results."""

from typing import Protocol

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import kernel
from manipnet.synthesis.objects.bvh import Bvh, trace_ray

try:
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    HAS_EMBREE = True
except ImportError:  # no wheel for this platform (Linux ARM)
    HAS_EMBREE = False


class RayScene(Protocol):
    """A mesh that rays can be traced against."""

    def trace(self, origins: Array, directions: Array) -> tuple[np.ndarray, np.ndarray]:
        """First hits of rays `(N, 3)` with unit directions.

        Returns the distance `(N,)` in metres, `inf` without a hit, and whether the hit surface faces away from the
        ray's origin `(N,)`, that is, whether the ray starts inside a closed mesh.
        """
        ...


class EmbreeRays:
    """Embree, called directly, which is about four times faster than through trimesh's wrapper."""

    def __init__(self, bvh: Bvh) -> None:
        self._scene = EmbreeScene()
        corners = np.ascontiguousarray(bvh.corners, dtype=np.float32).reshape(-1, 3)
        TriangleMesh(self._scene, corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3))

    def trace(self, origins: Array, directions: Array) -> tuple[np.ndarray, np.ndarray]:
        """See `RayScene.trace`."""
        starts = np.ascontiguousarray(origins, dtype=np.float32)
        aims = np.ascontiguousarray(directions, dtype=np.float32)
        hits = self._scene.run(starts, aims, query="INTERSECT", output=True)
        facing_away = np.empty(len(aims), np.bool_)
        _finish_hits(hits["primID"], hits["Ng"], aims, hits["tfar"], facing_away)
        return hits["tfar"], facing_away


@kernel
def _finish_hits(
    triangle: np.ndarray, normals: np.ndarray, directions: np.ndarray, distance: np.ndarray, facing_away: np.ndarray
):
    """Set the `distance` of Embree's misses, and find which hit surfaces face away."""
    for i in range(len(triangle)):
        n, d = normals[i], directions[i]
        missed = triangle[i] < 0
        facing_away[i] = not missed and n[0] * d[0] + n[1] * d[1] + n[2] * d[2] > 0.0
        if missed:
            distance[i] = np.inf


class TreeRays:
    """Our own tree, for platforms without Embree."""

    def __init__(self, bvh: Bvh) -> None:
        self._bvh = bvh

    def trace(self, origins: Array, directions: Array) -> tuple[np.ndarray, np.ndarray]:
        """See `RayScene.trace`."""
        distance, facing_away = np.empty(len(origins)), np.empty(len(origins), np.bool_)
        _trace_all(
            self._bvh,
            np.asarray(origins, np.float64),
            np.asarray(directions, np.float64),
            distance,
            facing_away,
        )
        return distance, facing_away


def ray_scene(bvh: Bvh) -> RayScene:
    """The fastest ray scene on this platform."""
    return EmbreeRays(bvh) if HAS_EMBREE else TreeRays(bvh)


@kernel
def _trace_all(bvh: Bvh, origins: Array, directions: Array, distance: Array, facing_away: np.ndarray):
    for i in range(len(origins)):
        d = directions[i]
        hit, triangle = trace_ray(bvh, origins[i, 0], origins[i, 1], origins[i, 2], d[0], d[1], d[2])
        distance[i] = hit
        n = bvh.normals[triangle, 0]
        facing_away[i] = triangle >= 0 and n[0] * d[0] + n[1] * d[1] + n[2] * d[2] > 0.0
