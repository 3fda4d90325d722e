"""A grid of signed distances around a closed mesh: cheap far look-ups, a first guess for exact ones, and robust signs.

The paper's section 5.3 pre-computes a field, finds the surface with it and then computes the exact distance. Here the
field alone answers where the surface is several cells away (trilinear interpolation is then within a small fraction
of a millimetre) and names a near triangle where it is not.
"""

from typing import NamedTuple

import numpy as np

from manipnet.geometry import Array
from manipnet.kernels import njit
from manipnet.objects.bvh import Bvh, closest_point, closest_points_parallel

MARGIN_M = 0.12
"""How far the grid reaches beyond the mesh: the sensors saturate at 0.10 m."""
RESOLUTION = 88
"""Grid points along the longest side."""
EXACT_WITHIN_CELLS = 3.0
"""Nearer to the surface than this, a distance is refined exactly."""
_NODE_REACH_CELLS = 0.87
"""No grid point is farther than half a cell diagonal from a query."""


class Field(NamedTuple):
    """Signed distances (negative inside) and nearest triangles on a regular grid."""

    origin: Array
    cell_m: float
    distance: np.ndarray
    """`(X, Y, Z)` float32, metres."""
    triangle: np.ndarray
    """`(X, Y, Z)` int32, index into the tree's triangles."""


def build_field(bvh: Bvh) -> Field:
    """Sample the exact distance to `bvh` on a grid; the sign is the winding number along vertical lines."""
    lower, upper = bvh.boxes[0, :3] - MARGIN_M, bvh.boxes[0, 3:] + MARGIN_M
    cell = float(np.max(upper - lower)) / (RESOLUTION - 1)
    shape = np.ceil((upper - lower) / cell).astype(np.int64) + 1
    axes = [lower[k] + cell * np.arange(shape[k]) for k in range(3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    distance, closest = np.empty(len(points)), np.empty_like(points)
    triangle = np.empty(len(points), np.int32)
    closest_points_parallel(bvh, points, distance, closest, triangle)
    inside = _inside_by_columns(bvh.corners, lower, cell, shape[0], shape[1], shape[2])
    distance = np.where(inside, -1.0, 1.0) * np.abs(distance).reshape(shape)
    return Field(lower, cell, distance.astype(np.float32), triangle.reshape(shape))


@njit(cache=True, nogil=True)
def _column_crossings(corners, lower, cell, nx, ny, starts, heights, signs):
    """Where triangles cross the grid's vertical (z) lines. With empty `heights` only counts into `starts`."""
    filling = len(heights) > 0
    # a tiny irrational shift keeps lines off shared edges and corners
    x0, y0 = lower[0] + 1.3e-7 * np.sqrt(2.0), lower[1] + 1.1e-7 * np.sqrt(3.0)
    for f in range(len(corners)):
        a, b, c = corners[f, 0], corners[f, 1], corners[f, 2]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if area == 0.0:
            continue
        first_x = max(int(np.ceil((min(a[0], b[0], c[0]) - x0) / cell)), 0)
        last_x = min(int(np.floor((max(a[0], b[0], c[0]) - x0) / cell)), nx - 1)
        first_y = max(int(np.ceil((min(a[1], b[1], c[1]) - y0) / cell)), 0)
        last_y = min(int(np.floor((max(a[1], b[1], c[1]) - y0) / cell)), ny - 1)
        for i in range(first_x, last_x + 1):
            for j in range(first_y, last_y + 1):
                x, y = x0 + i * cell, y0 + j * cell
                u = ((b[0] - x) * (c[1] - y) - (b[1] - y) * (c[0] - x)) / area
                v = ((c[0] - x) * (a[1] - y) - (c[1] - y) * (a[0] - x)) / area
                w = 1.0 - u - v
                if u < 0.0 or v < 0.0 or w < 0.0:
                    continue
                column = i * ny + j
                if filling:
                    heights[starts[column]] = u * a[2] + v * b[2] + w * c[2]
                    signs[starts[column]] = 1 if area > 0.0 else -1
                starts[column] += 1


@njit(cache=True, nogil=True)
def _inside_by_columns(corners, lower, cell, nx, ny, nz):
    """Winding number above one half at every grid point, by counting oriented crossings from above."""
    counts = np.zeros(nx * ny, np.int64)
    _column_crossings(corners, lower, cell, nx, ny, counts, np.empty(0), np.empty(0, np.int8))
    ends = np.cumsum(counts)
    starts = ends - counts
    heights, signs = np.empty(max(ends[-1], 1)), np.empty(max(ends[-1], 1), np.int8)
    _column_crossings(corners, lower, cell, nx, ny, starts.copy(), heights, signs)
    inside = np.zeros((nx, ny, nz), np.bool_)
    for column in range(nx * ny):
        if counts[column] == 0:
            continue
        for k in range(nz):
            z, winding = lower[2] + k * cell, 0
            for crossing in range(starts[column], ends[column]):
                if heights[crossing] > z:
                    winding += signs[crossing]
            inside[column // ny, column % ny, k] = winding > 0
    return inside


@njit(cache=True, nogil=True)
def field_distance(field, px, py, pz):
    """Trilinear signed distance and its gradient at one point: `(distance, gx, gy, gz)`; clamped outside the grid."""
    d, cell = field.distance, field.cell_m
    nx, ny, nz = d.shape
    x = min(max((px - field.origin[0]) / cell, 0.0), nx - 1.000001)
    y = min(max((py - field.origin[1]) / cell, 0.0), ny - 1.000001)
    z = min(max((pz - field.origin[2]) / cell, 0.0), nz - 1.000001)
    i, j, k = int(x), int(y), int(z)
    u, v, w = x - i, y - j, z - k
    d000, d001, d010, d011 = d[i, j, k], d[i, j, k + 1], d[i, j + 1, k], d[i, j + 1, k + 1]
    d100, d101, d110, d111 = d[i + 1, j, k], d[i + 1, j, k + 1], d[i + 1, j + 1, k], d[i + 1, j + 1, k + 1]
    d00, d01 = d000 + u * (d100 - d000), d001 + u * (d101 - d001)
    d10, d11 = d010 + u * (d110 - d010), d011 + u * (d111 - d011)
    d0, d1 = d00 + v * (d10 - d00), d01 + v * (d11 - d01)
    gx = (1 - v) * ((1 - w) * (d100 - d000) + w * (d101 - d001)) + v * ((1 - w) * (d110 - d010) + w * (d111 - d011))
    gy = (1 - w) * (d10 - d00) + w * (d11 - d01)
    return d0 + w * (d1 - d0), gx / cell, gy / cell, (d1 - d0) / cell


@njit(cache=True, nogil=True)
def signed_distance(bvh, field, px, py, pz, exact_within_m):
    """Signed distance and outward unit direction at one point: `(distance, nx, ny, nz)`.

    Exact where the field is within `exact_within_m` of the surface (`inf`: always), interpolated beyond.
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
    # farther from the surface than any grid point is from here, that grid point has our sign: it holds even where
    # a mesh crosses itself and pseudo-normals do not
    if abs(d) > _NODE_REACH_CELLS * cell and (field.distance[i, j, k] < 0.0) != (d < 0.0):
        on_grid = abs(px - field.origin[0] - i * cell) <= cell and abs(py - field.origin[1] - j * cell) <= cell
        if on_grid and abs(pz - field.origin[2] - k * cell) <= cell:
            d = -d
    if abs(d) < 1e-7:
        n = bvh.normals
        return d, n[triangle, region, 0], n[triangle, region, 1], n[triangle, region, 2]
    return d, (px - x) / d, (py - y) / d, (pz - z) / d
