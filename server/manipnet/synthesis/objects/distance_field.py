"""A grid of signed distances around a closed mesh: cheap look-ups, a first guess for exact distances, and robust signs.

The paper (section 5.3) computes a field in advance, finds the surface with it and then computes the exact distance.
Here the field alone answers if the surface is several cells away, where trilinear interpolation errs by a small
fraction of a millimetre. Nearer to the surface it names a near triangle, from which the exact search starts.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, kernel
from manipnet.synthesis.objects.bvh import Bvh, closest_point

MARGIN_M = 0.12
"""The grid extends this far beyond the mesh; the sensors saturate at 0.10 m."""
RESOLUTION = 88
"""Grid points along the longest side."""
EXACT_WITHIN_CELLS = 3.0
"""Distances below this many cells are computed exactly."""
_NODE_REACH_CELLS = 0.87
"""The grid point nearest to a query is at most half a cell diagonal away."""


class Field(NamedTuple):
    """Signed distances (negative inside) and nearest triangles on a regular grid."""

    origin: Array
    cell_m: float
    distance: np.ndarray
    """`(X, Y, Z)` float32, metres."""
    triangle: np.ndarray
    """`(X, Y, Z)` int32, index among the tree's triangles."""


def build_field(bvh: Bvh) -> Field:
    """Sample the exact distance to `bvh` on a grid; the sign comes from winding numbers along vertical lines."""
    lower, upper = bvh.boxes[0, :3] - MARGIN_M, bvh.boxes[0, 3:] + MARGIN_M
    cell = float(np.max(upper - lower)) / (RESOLUTION - 1)
    shape = np.ceil((upper - lower) / cell).astype(np.int64) + 1
    distance, triangle = np.empty(shape, np.float32), np.empty(shape, np.int32)
    workers = os.cpu_count() or 1
    slabs = np.array_split(np.arange(shape[0]), 4 * workers)
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(lambda slab: _sample(bvh, lower, cell, slab, distance, triangle), slabs))
    inside = _inside_by_columns(bvh.corners, lower, cell, shape)
    np.negative(distance, out=distance, where=inside)
    return Field(lower, cell, distance, triangle)


@kernel
def _sample(bvh: Bvh, lower: Array, cell: float, slab: np.ndarray, distance: np.ndarray, triangle: np.ndarray):
    """Unsigned distances and nearest triangles of the grid points whose first index is in `slab`."""
    near = -1
    for i in slab:
        for j in range(distance.shape[1]):
            for k in range(distance.shape[2]):
                x, y, z = lower[0] + cell * i, lower[1] + cell * j, lower[2] + cell * k
                # the triangle nearest to the last point is a good guess for this one
                d, _, _, _, near, _ = closest_point(bvh, x, y, z, near)
                distance[i, j, k], triangle[i, j, k] = abs(d), near


def _inside_by_columns(corners: Array, lower: Array, cell: float, shape: np.ndarray) -> np.ndarray:
    """Whether the winding number of every grid point is above one half, by counting the oriented crossings above it."""
    # a tiny irrational shift keeps the lines off shared edges and corners
    origin = lower[:2] + 1e-7 * np.sqrt([2.2, 3.3])
    flat = (corners[:, :, :2] - origin) / cell
    first = np.maximum(np.ceil(flat.min(axis=1)).astype(np.int64), 0)
    sizes = np.maximum(np.minimum(np.floor(flat.max(axis=1)).astype(np.int64), shape[:2] - 1) - first + 1, 0)
    counts = sizes.prod(axis=1)
    # every grid line in every triangle's bounding rectangle
    face = np.repeat(np.arange(len(corners)), counts)
    nth = np.arange(len(face)) - np.repeat(np.cumsum(counts) - counts, counts)
    i, j = first[face, 0] + nth // sizes[face, 1], first[face, 1] + nth % sizes[face, 1]
    a, b, c = (flat[face, corner] - np.stack([i, j], axis=1) for corner in range(3))
    weights = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)], axis=1)
    area = weights.sum(axis=1)
    hit = (area != 0.0) & np.all(weights * np.sign(area)[:, None] >= 0.0, axis=1)
    face, weights, area = face[hit], weights[hit], area[hit]
    heights = np.sum(weights * corners[face, :, 2], axis=1) / area
    below = np.clip(np.ceil((heights - lower[2]) / cell).astype(np.int64), 0, shape[2])
    # a crossing counts for every point below it
    steps = np.zeros((shape[0], shape[1], shape[2] + 1), np.int32)
    np.add.at(steps, (i[hit], j[hit], below), np.sign(area).astype(np.int32))
    return np.cumsum(steps[:, :, ::-1], axis=2)[:, :, -2::-1] > 0


def _cross(a: Array, b: Array) -> Array:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


@inner
def field_distance(field: Field, px: float, py: float, pz: float):
    """Trilinear signed distance at one point and its gradient, `(distance, gx, gy, gz)`; clamped outside the grid."""
    d, per_m = field.distance, 1.0 / field.cell_m
    nx, ny, nz = d.shape
    x = min(max((px - field.origin[0]) * per_m, 0.0), nx - 1.000001)
    y = min(max((py - field.origin[1]) * per_m, 0.0), ny - 1.000001)
    z = min(max((pz - field.origin[2]) * per_m, 0.0), nz - 1.000001)
    # numbers without a sign: an index that may be negative is tested at every access
    i, j, k, one = np.uint64(x), np.uint64(y), np.uint64(z), np.uint64(1)
    u, v, w = x - i, y - j, z - k
    d000, d001, d010, d011 = d[i, j, k], d[i, j, k + one], d[i, j + one, k], d[i, j + one, k + one]
    d100, d101, d110, d111 = (
        d[i + one, j, k],
        d[i + one, j, k + one],
        d[i + one, j + one, k],
        d[i + one, j + one, k + one],
    )
    d00, d01 = d000 + u * (d100 - d000), d001 + u * (d101 - d001)
    d10, d11 = d010 + u * (d110 - d010), d011 + u * (d111 - d011)
    d0, d1 = d00 + v * (d10 - d00), d01 + v * (d11 - d01)
    gx = (1 - v) * ((1 - w) * (d100 - d000) + w * (d101 - d001)) + v * ((1 - w) * (d110 - d010) + w * (d111 - d011))
    gy = (1 - w) * (d10 - d00) + w * (d11 - d01)
    return d0 + w * (d1 - d0), gx * per_m, gy * per_m, (d1 - d0) * per_m


@inner
def signed_distance(bvh: Bvh, field: Field, px: float, py: float, pz: float, exact_within_m: float):
    """Signed distance at one point and the outward unit direction, `(distance, nx, ny, nz)`.

    They are exact if the field's value is below `exact_within_m` (`inf`: always), and interpolated otherwise.
    """
    rough, gx, gy, gz = field_distance(field, px, py, pz)
    if abs(rough) > exact_within_m:
        length = max(np.sqrt(gx * gx + gy * gy + gz * gz), 1e-9)
        return rough, gx / length, gy / length, gz / length
    cell = field.cell_m
    nx, ny, nz = field.distance.shape
    i = min(max(round((px - field.origin[0]) / cell), 0), nx - 1)
    j = min(max(round((py - field.origin[1]) / cell), 0), ny - 1)
    k = min(max(round((pz - field.origin[2]) / cell), 0), nz - 1)
    d, x, y, z, triangle, region = closest_point(bvh, px, py, pz, field.triangle[i, j, k])
    # a point farther from the surface than from its grid point has the sign of that grid point; this holds even where a
    # mesh crosses itself, and pseudo-normals fail
    if abs(d) > _NODE_REACH_CELLS * cell and (field.distance[i, j, k] < 0.0) != (d < 0.0):
        on_grid = abs(px - field.origin[0] - i * cell) <= cell and abs(py - field.origin[1] - j * cell) <= cell
        if on_grid and abs(pz - field.origin[2] - k * cell) <= cell:
            d = -d
    if abs(d) < 1e-7:
        n = bvh.normals
        return d, n[triangle, region, 0], n[triangle, region, 1], n[triangle, region, 2]
    return d, (px - x) / d, (py - y) / d, (pz - z) / d
