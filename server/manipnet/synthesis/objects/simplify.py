"""Reduces large meshes for the sensors.

A tenth of a millimetre makes no difference to a hand, and a tree that fits into the processor's caches is searched
faster.
"""

import logging
from typing import Final

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import kernel
from manipnet.synthesis.objects.bvh import Bvh, build_bvh, closest_point
from manipnet.synthesis.objects.mesh import ClosedMesh, MeshError, closed_mesh

MOST_TRIANGLES: Final = 25_000
"""Meshes with at most this many triangles are sensed as they are."""
FEWER_TRIANGLES: Final = 20_000
"""Larger ones are reduced to this many."""
WITHIN_M: Final = 1e-4
"""The largest distance allowed from any vertex or triangle centre of either mesh to the other mesh."""
_log = logging.getLogger(__name__)


def simplified(mesh: ClosedMesh) -> ClosedMesh:
    """A large mesh with `FEWER_TRIANGLES`; the mesh itself if it is small or would change by more than `WITHIN_M`."""
    if len(mesh.faces) <= MOST_TRIANGLES:
        return mesh
    import fast_simplification

    # the thresholds of the library are made for millimetres
    vertices, faces, *_ = fast_simplification.simplify(1e3 * mesh.vertices, mesh.faces, target_count=FEWER_TRIANGLES)
    try:
        fewer = closed_mesh(1e-3 * np.asarray(vertices, np.float64), faces, mesh.name)
    except MeshError as error:
        _log.info("%s is sensed with all its %d triangles, because with fewer it %s", mesh.name, len(mesh.faces), error)
        return mesh
    apart_m = max(_farthest(mesh, fewer), _farthest(fewer, mesh))
    if apart_m > WITHIN_M:
        text = "%s is sensed with all its %d triangles, because with fewer it would be up to %.2f mm off"
        _log.info(text, mesh.name, len(mesh.faces), 1e3 * apart_m)
        return mesh
    return fewer


def _farthest(mesh: ClosedMesh, other: ClosedMesh) -> float:
    """The largest distance of a vertex or triangle centre from the `other` mesh, metres."""
    corners = mesh.vertices[mesh.faces]
    points = np.concatenate([corners, corners.mean(axis=1, keepdims=True)], axis=1).reshape(-1, 3)
    return _farthest_from(build_bvh(other.vertices, other.faces), points)


@kernel
def _farthest_from(bvh: Bvh, points: Array):
    worst, near = 0.0, -1
    for p in points:
        # the triangle nearest to the last point is a good guess for this one
        distance, _, _, _, near, _ = closest_point(bvh, p[0], p[1], p[2], near)
        worst = max(worst, abs(distance))
    return worst
