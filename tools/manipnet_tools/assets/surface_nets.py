"""A closed triangle mesh of an implicit surface: naive surface nets, whose vertices are then moved onto the surface.

There is one vertex per grid cell that the surface crosses, and one quad per grid edge that it crosses. Source: Gibson,
"Constrained elastic surface nets", 1998.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import Array

Field = Callable[[Array], Array]
"""Signed distance at points `(n, 3)`, negative inside, as `(n,)`."""

_CORNERS = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])
_EDGES = [(a, b) for a in range(8) for b in range(a + 1, 8) if np.abs(_CORNERS[a] - _CORNERS[b]).sum() == 1]


def extract(field: Field, low: Array, high: Array, cell: float) -> tuple[Array, NDArray[np.int64]]:
    """Vertices `(V, 3)` and outward triangles `(F, 3)` of `field == 0` in the box from `low` to `high`.

    Raises `ValueError` if the surface leaves the box, which would make a hole.
    """
    axes = [np.arange(a, b + cell, cell) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    values = field(grid.reshape(-1, 3)).reshape(grid.shape[:3])
    inside = values < 0.0
    if np.any(inside & ~_interior(inside.shape)):
        raise ValueError("the surface reaches the border of the box; enlarge the box between low and high")
    vertices, index = _cell_vertices(values, inside)
    return vertices * cell + low, _triangles(inside, index, vertices)


def polish(field: Field, vertices: Array, faces: NDArray[np.int64], rounds: int) -> tuple[Array, NDArray[np.float64]]:
    """Spread the vertices evenly along the surface and move them onto it; returns them with their unit normals."""
    for _ in range(rounds):
        normals = gradient(field, vertices)
        drift = neighbour_mean(vertices, faces) - vertices
        drift -= normals * np.sum(drift * normals, axis=1, keepdims=True)
        vertices = vertices + 0.5 * drift
        vertices = vertices - gradient(field, vertices) * field(vertices)[:, None]
    return vertices, gradient(field, vertices)


def gradient(field: Field, points: Array, step: float = 2e-4) -> Array:
    """Unit gradient of the field at points `(n, 3)`, by central differences."""
    slopes = [field(points + step * axis) - field(points - step * axis) for axis in np.eye(3)]
    normals = np.stack(slopes, axis=1)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def neighbour_mean(values: Array, faces: NDArray[np.int64]) -> Array:
    """Mean over the adjacent vertices of per-vertex `values` `(V, c)` on a closed mesh."""
    total, count = np.zeros_like(values), np.zeros((len(values), 1))
    for a, b in ((0, 1), (1, 2), (2, 0)):  # in a closed mesh each edge appears once in each direction
        np.add.at(total, faces[:, a], values[faces[:, b]])
        np.add.at(count, faces[:, a], 1.0)
    return total / count


def _interior(shape: tuple[int, ...]) -> NDArray[np.bool_]:
    mask = np.zeros(shape, dtype=bool)
    mask[1:-1, 1:-1, 1:-1] = True
    return mask


def _cell_vertices(values: Array, inside: NDArray[np.bool_]) -> tuple[Array, NDArray[np.int64]]:
    """Mean of the edge crossings of each crossed cell, in grid units, and the index of each cell's vertex."""
    nx, ny, nz = (n - 1 for n in values.shape)
    corner = [np.s_[i : i + nx, j : j + ny, k : k + nz] for i, j, k in _CORNERS]
    total, count = np.zeros((nx, ny, nz, 3)), np.zeros((nx, ny, nz))
    for a, b in _EDGES:
        va, vb = values[corner[a]], values[corner[b]]
        crossed = inside[corner[a]] != inside[corner[b]]
        fraction = np.where(crossed, va / np.where(crossed, va - vb, 1.0), 0.0)
        total += crossed[..., None] * (_CORNERS[a] + fraction[..., None] * (_CORNERS[b] - _CORNERS[a]))
        count += crossed
    cells = np.argwhere(count > 0)
    index = np.full((nx, ny, nz), -1)
    index[tuple(cells.T)] = np.arange(len(cells))
    return cells + total[tuple(cells.T)] / count[tuple(cells.T)][:, None], index


def _triangles(inside: NDArray[np.bool_], index: NDArray[np.int64], vertices: Array) -> NDArray[np.int64]:
    """Two triangles per crossed grid edge, split along the shorter diagonal, wound to face outwards."""
    quads = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        near = np.take(inside, range(inside.shape[axis] - 1), axis=axis)
        far = np.take(inside, range(1, inside.shape[axis]), axis=axis)
        at = np.argwhere(near != far)
        ring = []
        for du, dv in ((-1, -1), (0, -1), (0, 0), (-1, 0)):
            cell = at.copy()
            cell[:, u] += du
            cell[:, v] += dv
            ring.append(index[tuple(cell.T)])
        quad = np.stack(ring, axis=1)
        outward = near[tuple(at.T)]
        quads.append(np.where(outward[:, None], quad, quad[:, ::-1]))
    quad = np.concatenate(quads)
    corners = vertices[quad]
    diagonals = np.linalg.norm(corners[:, [0, 1]] - corners[:, [2, 3]], axis=2)
    quad = np.where((diagonals[:, 0] <= diagonals[:, 1])[:, None], quad, np.roll(quad, -1, axis=1))
    return np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]])
