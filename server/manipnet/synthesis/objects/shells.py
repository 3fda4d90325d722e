"""Which shells of a mesh lie inside which: an object may have several, side by side or one in the cavity of another."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import Array
from manipnet.jit import kernel
from manipnet.synthesis.objects.bvh import Bvh, build_bvh, closest_point

_POINTS: Final = 64
"""A shell lies inside another if so many of its vertices do, which are spread over it."""
_TOUCHING: Final = 1e-5
"""A vertex nearer to the other shell than this, relative to the mesh's size, is neither inside nor outside."""


def nesting_depths(vertices: Array, faces: NDArray[np.int32], part: NDArray[np.int32]) -> NDArray[np.int64]:
    """The number of shells around each shell: vertices `(V, 3)`, faces `(F, 3)` of closed shells, `part (F,)` in order.

    A shell counts as inside another only as a whole, so parts that cross each other are not nested.
    """
    count = int(part.max()) + 1
    corners = vertices[faces]
    lower, upper = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(lower, part, corners.min(axis=1))
    np.maximum.at(upper, part, corners.max(axis=1))
    touching = _TOUCHING * float(np.ptp(vertices, axis=0).max())
    members = np.split(np.argsort(part, kind="stable"), np.cumsum(np.bincount(part))[:-1])
    depths = np.zeros(count, dtype=np.int64)
    for outer in range(count):
        inside_box = (lower >= lower[outer] - touching).all(axis=1) & (upper <= upper[outer] + touching).all(axis=1)
        inside_box[outer] = False
        if not inside_box.any():
            continue
        own = faces[members[outer]]
        bvh = build_bvh(vertices, own)
        sign = np.sign(
            np.einsum("ij,ij->i", vertices[own[:, 0]], np.cross(vertices[own[:, 1]], vertices[own[:, 2]])).sum()
        )
        for inner in np.flatnonzero(inside_box):
            points = vertices[np.unique(faces[members[inner]])]
            points = np.ascontiguousarray(points[:: max(len(points) // _POINTS, 1)])
            distances = np.empty(len(points))
            _distances_into(bvh, points, distances)
            clear = sign * distances[np.abs(distances) > touching]
            depths[inner] += bool(len(clear)) and bool((clear < 0.0).all())
    return depths


@kernel
def _distances_into(bvh: Bvh, points: Array, distances: Array):
    for i in range(len(points)):
        distances[i] = closest_point(bvh, points[i, 0], points[i, 1], points[i, 2], -1)[0]
