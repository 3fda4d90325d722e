"""A bounding volume hierarchy over triangles: exact closest points with signs, and ray hits.

Compiled with numba because a tick asks for several hundred closest points. The tree is two flat arrays, so it is
cached on disk as it is and shared by threads without locks. Signs come from angle-weighted pseudo-normals (Bærentzen
and Aanæs 2005), exact on closed meshes.
"""

from typing import NamedTuple

import numpy as np

from manipnet.geometry import Array
from manipnet.kernels import njit, prange

_BINS = 12
_LEAF_TRIANGLES = 3
_STACK = 96


class Bvh(NamedTuple):
    """Triangles in tree order. A tuple of arrays, so that numba kernels take it as one argument."""

    boxes: Array
    """`(N, 6)` lower and upper corner of each node, metres."""
    links: np.ndarray
    """`(N, 2)` int32: (first triangle, count) of a leaf, (left child, 0) of an inner node; right = left + 1."""
    corners: Array
    """`(F, 3, 3)` triangle corners, metres."""
    normals: Array
    """`(F, 7, 3)` pseudo-normals: face, edges 01 12 20, corners 0 1 2."""


@njit(cache=True, nogil=True)
def _order_triangles(corners):
    """Binned surface-area-heuristic build. Returns boxes, links and the order of the triangles in the leaves."""
    count = len(corners)
    lower, upper, middle = np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3))
    for f in range(count):
        for k in range(3):
            lower[f, k] = min(corners[f, 0, k], corners[f, 1, k], corners[f, 2, k])
            upper[f, k] = max(corners[f, 0, k], corners[f, 1, k], corners[f, 2, k])
            middle[f, k] = 0.5 * (lower[f, k] + upper[f, k])
    order = np.arange(count)
    boxes, links = np.empty((2 * count, 6)), np.zeros((2 * count, 2), np.int32)
    spans = np.empty((_STACK, 3), np.int64)
    spans[0, 0], spans[0, 1], spans[0, 2] = 0, 0, count
    depth, nodes = 1, 1
    while depth > 0:
        depth -= 1
        node, first, last = spans[depth, 0], spans[depth, 1], spans[depth, 2]
        boxes[node, :3], boxes[node, 3:] = np.inf, -np.inf
        center_lower, center_upper = np.full(3, np.inf), np.full(3, -np.inf)
        for i in range(first, last):
            f = order[i]
            for k in range(3):
                boxes[node, k] = min(boxes[node, k], lower[f, k])
                boxes[node, 3 + k] = max(boxes[node, 3 + k], upper[f, k])
                center_lower[k] = min(center_lower[k], middle[f, k])
                center_upper[k] = max(center_upper[k], middle[f, k])
        if last - first <= _LEAF_TRIANGLES or depth + 2 > _STACK:
            links[node, 0], links[node, 1] = first, last - first
            continue
        axis = 0
        for k in range(1, 3):
            if center_upper[k] - center_lower[k] > center_upper[axis] - center_lower[axis]:
                axis = k
        split = _partition(order, first, last, lower, upper, middle, axis, center_lower[axis], center_upper[axis])
        links[node, 0] = nodes
        spans[depth, 0], spans[depth, 1], spans[depth, 2] = nodes, first, split
        spans[depth + 1, 0], spans[depth + 1, 1], spans[depth + 1, 2] = nodes + 1, split, last
        depth, nodes = depth + 2, nodes + 2
    return boxes[:nodes].copy(), links[:nodes].copy(), order


@njit(cache=True, nogil=True)
def _partition(order, first, last, lower, upper, middle, axis, start, stop):
    """Reorder `order[first:last]` about the cheapest of the bin borders; returns where the right side begins."""
    if stop - start < 1e-12:
        return (first + last) // 2
    scale = _BINS * (1.0 - 1e-9) / (stop - start)
    counts = np.zeros(_BINS, np.int64)
    low, high = np.full((_BINS, 3), np.inf), np.full((_BINS, 3), -np.inf)
    for i in range(first, last):
        f = order[i]
        b = int((middle[f, axis] - start) * scale)
        counts[b] += 1
        for k in range(3):
            low[b, k], high[b, k] = min(low[b, k], lower[f, k]), max(high[b, k], upper[f, k])
    best, border = np.inf, -1
    for cut in range(1, _BINS):
        cost, empty = 0.0, False
        for side in range(2):
            span_low, span_high, total = np.full(3, np.inf), np.full(3, -np.inf), 0
            for b in range(0 if side == 0 else cut, cut if side == 0 else _BINS):
                total += counts[b]
                for k in range(3):
                    span_low[k], span_high[k] = min(span_low[k], low[b, k]), max(span_high[k], high[b, k])
            if total == 0:
                empty = True
                break
            x, y, z = span_high[0] - span_low[0], span_high[1] - span_low[1], span_high[2] - span_low[2]
            cost += total * (x * y + y * z + z * x)
        if not empty and cost < best:
            best, border = cost, cut
    if border < 0:
        return (first + last) // 2
    i, j = first, last - 1
    while i <= j:
        if int((middle[order[i], axis] - start) * scale) < border:
            i += 1
        else:
            order[i], order[j] = order[j], order[i]
            j -= 1
    return i


def build_bvh(vertices: Array, faces: np.ndarray) -> Bvh:
    """Build the tree of a closed, consistently wound mesh: vertices `(V, 3)` in metres, faces `(F, 3)`."""
    corners = np.ascontiguousarray(vertices, dtype=np.float64)[faces]
    boxes, links, order = _order_triangles(corners)
    return Bvh(boxes, links, corners[order], pseudo_normals(vertices, faces)[order])


def pseudo_normals(vertices: Array, faces: np.ndarray) -> Array:
    """Angle-weighted pseudo-normals `(F, 7, 3)` of each face, its edges 01, 12, 20 and its corners."""
    corners = np.asarray(vertices, dtype=np.float64)[faces]
    sides = np.roll(corners, -1, axis=1) - corners
    face = np.cross(sides[:, 0], sides[:, 1])
    face /= np.maximum(np.linalg.norm(face, axis=1, keepdims=True), 1e-30)
    unit = sides / np.maximum(np.linalg.norm(sides, axis=2, keepdims=True), 1e-30)
    angle = np.arccos(np.clip(-np.einsum("fki,fki->fk", unit, np.roll(unit, 1, axis=1)), -1.0, 1.0))
    at_vertex = np.zeros_like(vertices, dtype=np.float64)
    for k in range(3):
        np.add.at(at_vertex, faces[:, k], angle[:, k : k + 1] * face)
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2), axis=2).reshape(-1, 2)
    keys, index = np.unique(ends[:, 0].astype(np.int64) * len(vertices) + ends[:, 1], return_inverse=True)
    at_edge = np.zeros((len(keys), 3))
    np.add.at(at_edge, index, np.repeat(face, 3, axis=0))
    normals = np.concatenate([face[:, None], at_edge[index].reshape(-1, 3, 3), at_vertex[faces]], axis=1)
    return normals / np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-30)


@njit(cache=True, nogil=True, inline="always")
def _closest_on_triangle(px, py, pz, t, f):
    """Closest point of triangle `t[f]` of `t (F, 3, 3)`: coordinates and region (0 face, 1-3 edges, 4-6 corners).

    Ericson, Real-Time Collision Detection, section 5.1.5.
    """
    ax, ay, az = t[f, 0, 0], t[f, 0, 1], t[f, 0, 2]
    abx, aby, abz = t[f, 1, 0] - ax, t[f, 1, 1] - ay, t[f, 1, 2] - az
    acx, acy, acz = t[f, 2, 0] - ax, t[f, 2, 1] - ay, t[f, 2, 2] - az
    apx, apy, apz = px - ax, py - ay, pz - az
    d1 = abx * apx + aby * apy + abz * apz
    d2 = acx * apx + acy * apy + acz * apz
    if d1 <= 0.0 and d2 <= 0.0:
        return ax, ay, az, 4
    bpx, bpy, bpz = px - t[f, 1, 0], py - t[f, 1, 1], pz - t[f, 1, 2]
    d3 = abx * bpx + aby * bpy + abz * bpz
    d4 = acx * bpx + acy * bpy + acz * bpz
    if d3 >= 0.0 and d4 <= d3:
        return t[f, 1, 0], t[f, 1, 1], t[f, 1, 2], 5
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v = d1 / (d1 - d3)
        return ax + v * abx, ay + v * aby, az + v * abz, 1
    cpx, cpy, cpz = px - t[f, 2, 0], py - t[f, 2, 1], pz - t[f, 2, 2]
    d5 = abx * cpx + aby * cpy + abz * cpz
    d6 = acx * cpx + acy * cpy + acz * cpz
    if d6 >= 0.0 and d5 <= d6:
        return t[f, 2, 0], t[f, 2, 1], t[f, 2, 2], 6
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        w = d2 / (d2 - d6)
        return ax + w * acx, ay + w * acy, az + w * acz, 3
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return (
            t[f, 1, 0] + w * (t[f, 2, 0] - t[f, 1, 0]),
            t[f, 1, 1] + w * (t[f, 2, 1] - t[f, 1, 1]),
            t[f, 1, 2] + w * (t[f, 2, 2] - t[f, 1, 2]),
            2,
        )
    denominator = 1.0 / (va + vb + vc)
    v, w = vb * denominator, vc * denominator
    return ax + abx * v + acx * w, ay + aby * v + acy * w, az + abz * v + acz * w, 0


@njit(cache=True, nogil=True, inline="always")
def _box_distance_squared(boxes, node, px, py, pz):
    x = max(boxes[node, 0] - px, 0.0, px - boxes[node, 3])
    y = max(boxes[node, 1] - py, 0.0, py - boxes[node, 4])
    z = max(boxes[node, 2] - pz, 0.0, pz - boxes[node, 5])
    return x * x + y * y + z * z


@njit(cache=True, nogil=True)
def closest_point(bvh, px, py, pz, seed):
    """Signed distance, closest point and its triangle for one query; `seed` is a triangle guessed to be near, or -1.

    Returns `(signed distance, cx, cy, cz, triangle, region)`; the distance is negative inside.
    """
    boxes, links, corners, normals = bvh.boxes, bvh.links, bvh.corners, bvh.normals
    best, bx, by, bz, triangle, region = np.inf, 0.0, 0.0, 0.0, -1, 0
    if seed >= 0:
        bx, by, bz, region = _closest_on_triangle(px, py, pz, corners, seed)
        best = (px - bx) ** 2 + (py - by) ** 2 + (pz - bz) ** 2
        triangle = seed
    stack, near = np.empty(_STACK, np.int32), np.empty(_STACK)
    stack[0], near[0], depth = 0, 0.0, 1
    while depth > 0:
        depth -= 1
        if near[depth] >= best:
            continue
        node = stack[depth]
        first, count = links[node, 0], links[node, 1]
        if count > 0:
            for f in range(first, first + count):
                x, y, z, r = _closest_on_triangle(px, py, pz, corners, f)
                d = (px - x) ** 2 + (py - y) ** 2 + (pz - z) ** 2
                if d < best:
                    best, bx, by, bz, triangle, region = d, x, y, z, f, r
            continue
        left = _box_distance_squared(boxes, first, px, py, pz)
        right = _box_distance_squared(boxes, first + 1, px, py, pz)
        farther = first + 1 if left < right else first
        for child, d in ((farther, max(left, right)), (2 * first + 1 - farther, min(left, right))):
            if d < best:
                stack[depth], near[depth] = child, d
                depth += 1
    side = (
        (px - bx) * normals[triangle, region, 0]
        + (py - by) * normals[triangle, region, 1]
        + (pz - bz) * normals[triangle, region, 2]
    )
    distance = np.sqrt(best)
    return (-distance if side < 0.0 else distance), bx, by, bz, triangle, region


@njit(cache=True, nogil=True, parallel=True)
def closest_points_parallel(bvh, points, distance, closest, triangle):
    """Unseeded closest points of many `points (N, 3)` on all cores, for building fields and for tools."""
    for i in prange(len(points)):
        d, x, y, z, t, _ = closest_point(bvh, points[i, 0], points[i, 1], points[i, 2], np.int32(-1))
        distance[i], triangle[i] = d, t
        closest[i, 0], closest[i, 1], closest[i, 2] = x, y, z


@njit(cache=True, nogil=True)
def trace_ray(bvh, ox, oy, oz, dx, dy, dz):
    """First hit of one ray (Möller and Trumbore 1997): distance along the unit direction, `inf` without a hit, and
    the triangle."""
    ix = 1.0 / dx if dx != 0.0 else np.inf
    iy = 1.0 / dy if dy != 0.0 else np.inf
    iz = 1.0 / dz if dz != 0.0 else np.inf
    best, triangle = np.inf, -1
    stack = np.empty(_STACK, np.int32)
    stack[0], depth = 0, 1
    while depth > 0:
        depth -= 1
        node = stack[depth]
        box = bvh.boxes[node]
        enter, leave = 0.0, best
        for k in range(3):
            o, i, d = (ox, ix, dx) if k == 0 else ((oy, iy, dy) if k == 1 else (oz, iz, dz))
            if d == 0.0:
                if o < box[k] or o > box[3 + k]:
                    enter = np.inf
                continue
            t0, t1 = (box[k] - o) * i, (box[3 + k] - o) * i
            enter, leave = max(enter, min(t0, t1)), min(leave, max(t0, t1))
        if enter > leave:
            continue
        first, count = bvh.links[node, 0], bvh.links[node, 1]
        if count == 0:
            stack[depth], stack[depth + 1] = first, first + 1
            depth += 2
            continue
        for f in range(first, first + count):
            t = bvh.corners[f]
            e1x, e1y, e1z = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
            e2x, e2y, e2z = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
            hx, hy, hz = dy * e2z - dz * e2y, dz * e2x - dx * e2z, dx * e2y - dy * e2x
            det = e1x * hx + e1y * hy + e1z * hz
            if abs(det) < 1e-18:
                continue
            sx, sy, sz = ox - t[0, 0], oy - t[0, 1], oz - t[0, 2]
            u = (sx * hx + sy * hy + sz * hz) / det
            qx, qy, qz = sy * e1z - sz * e1y, sz * e1x - sx * e1z, sx * e1y - sy * e1x
            v = (dx * qx + dy * qy + dz * qz) / det
            hit = (e2x * qx + e2y * qy + e2z * qz) / det
            if u >= 0.0 and v >= 0.0 and u + v <= 1.0 and 0.0 <= hit < best:
                best, triangle = hit, f
    return best, triangle
