"""An object's surface as thin convex pieces, for simulators whose collisions know convex bodies only.

Triangles are grouped by place and normal. Each group becomes the hull of its triangles and of the same triangles moved
inward, so that hollows, handles and cavities stay open.
"""

import numpy as np
from scipy.cluster.vq import kmeans2
from trimesh.remesh import subdivide_to_size

from manipnet.geometry import Array
from manipnet.synthesis.objects.mesh import ClosedMesh

PIECES = 120
THICKNESS_M = 0.003
LONGEST_EDGE_M = 0.008
"""Longer edges are divided first, or the large triangles of a box could not be grouped by place."""
NORMAL_WEIGHT_M = 0.02
"""Two triangles whose normals are at right angles are as different as two that are 28 mm apart."""


def shell_pieces(mesh: ClosedMesh, count: int = PIECES) -> list[Array]:
    """The points `(n, 3)` whose convex hulls cover the surface of the mesh, in its frame; about `count` pieces."""
    vertices, faces = subdivide_to_size(mesh.vertices, mesh.faces, LONGEST_EDGE_M, max_iter=12)[:2]
    corners = np.asarray(vertices)[np.asarray(faces)]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(cross, axis=1)
    corners, normals = corners[size > 0.0], cross[size > 0.0] / size[size > 0.0, None]
    features = np.concatenate([corners.mean(axis=1), NORMAL_WEIGHT_M * normals], axis=1)
    group = np.asarray(kmeans2(features, count, minit="++", rng=np.random.default_rng(0), missing="warn")[1])
    return [_piece(corners[group == k], normals[group == k]) for k in np.unique(group)]


def _piece(corners: Array, normals: Array) -> Array:
    outer = corners.reshape(-1, 3)
    inner = outer - THICKNESS_M * np.repeat(normals, 3, axis=0)
    return np.unique(np.concatenate([outer, inner]).round(7), axis=0)
