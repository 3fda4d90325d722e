"""A bounding volume hierarchy over triangles: exact closest points with signs, and ray hits.

Its queries are compiled, because a tick makes several hundred of them. The tree is two flat arrays, so it is cached on
disk as it is and shared by threads without locks. Signs come from angle-weighted pseudo-normals, which are exact on
closed meshes (Bærentzen and Aanæs 2005).
"""

from typing import NamedTuple

import numpy as np
from numba import types

from manipnet.geometry import Array
from manipnet.jit import inner, stack_array

_BINS = 12
_LEAF_TRIANGLES = 3
_BINNED_LEVELS = 48
"""Deeper nodes are halved, because they are degenerate and the depth of the tree must stay bounded."""
_MOST_LEVELS = _BINNED_LEVELS + 24
_STACK = 96
"""Enough for a walk down any tree with one waiting node per level."""
_nodes, _numbers = stack_array(_STACK, dtype=types.int32), stack_array(_STACK)


class Bvh(NamedTuple):
    """Triangles in tree order. It is a tuple of arrays, which kernels take as one argument."""

    boxes: Array
    """`(N, 6)` lower and upper corner of each node, metres."""
    links: np.ndarray
    """`(N, 2)` int32: (first triangle, count) of a leaf; (left child, 0) of an inner node; the right child is next."""
    corners: Array
    """`(F, 3, 3)` triangle corners, metres."""
    normals: Array
    """`(F, 7, 3)` pseudo-normals: face, edges 01 12 20, corners 0 1 2."""


def _order_triangles(corners: Array) -> tuple[Array, np.ndarray, np.ndarray]:
    """Build by the binned surface area heuristic, level by level; returns boxes, links and triangles in leaf order."""
    lower, upper = corners.min(axis=1), corners.max(axis=1)
    order = np.arange(len(corners))
    firsts, counts = np.zeros(1, np.int64), np.array([len(corners)])
    boxes, links, nodes = [], [], 1
    for level in range(_MOST_LEVELS):
        boxes.append(_boxes(lower, upper, order, firsts, counts))
        inner = counts > _LEAF_TRIANGLES
        links.append(np.stack([firsts, counts], axis=1))
        links[-1][inner, 0] = nodes + 2 * np.arange(inner.sum())
        links[-1][inner, 1] = 0
        if not inner.any():
            break
        firsts, counts = firsts[inner], counts[inner]
        nodes += 2 * len(firsts)
        lefts = _partition(lower, upper, order, firsts, counts, by_middle=level >= _BINNED_LEVELS)
        firsts = np.stack([firsts, firsts + lefts], axis=1).ravel()
        counts = np.stack([lefts, counts - lefts], axis=1).ravel()
    return np.concatenate(boxes), np.concatenate(links).astype(np.int32), order


def _members(order: np.ndarray, firsts: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The places in `order` of the triangles of some nodes, node after node, and where each node begins among them."""
    starts = np.cumsum(counts) - counts
    return np.repeat(firsts - starts, counts) + np.arange(counts.sum()), starts


def _boxes(lower: Array, upper: Array, order: np.ndarray, firsts: np.ndarray, counts: np.ndarray) -> Array:
    at, starts = _members(order, firsts, counts)
    low, high = np.minimum.reduceat(lower[order[at]], starts), np.maximum.reduceat(upper[order[at]], starts)
    return np.concatenate([low, high], axis=1)


def _partition(
    lower: Array, upper: Array, order: np.ndarray, firsts: np.ndarray, counts: np.ndarray, by_middle: bool
) -> np.ndarray:
    """Sort the triangles of every node along its longest axis, by bins; returns how many go to the left, at least one.

    The border is the cheapest one between bins, or the middle if all triangles are in one bin.
    """
    at, starts = _members(order, firsts, counts)
    triangles, node = order[at], np.repeat(np.arange(len(counts)), counts)
    middle = 0.5 * (lower + upper)[triangles]
    start, stop = np.minimum.reduceat(middle, starts), np.maximum.reduceat(middle, starts)
    axis = np.argmax(stop - start, axis=1)
    each = np.arange(len(counts))
    start, extent = start[each, axis], (stop - start)[each, axis]
    scale = _BINS * (1.0 - 1e-9) / np.maximum(extent, 1e-12)
    bins = node * _BINS + ((middle[np.arange(len(at)), axis[node]] - start[node]) * scale[node]).astype(np.int64)
    by_bin = np.argsort(bins, kind="stable")
    order[at] = triangles = triangles[by_bin]
    sizes = np.bincount(bins, minlength=len(counts) * _BINS)
    used = np.flatnonzero(sizes)
    low, high = np.full((len(sizes), 3), np.inf), np.full((len(sizes), 3), -np.inf)
    begins = (np.cumsum(sizes) - sizes)[used]
    low[used] = np.minimum.reduceat(lower[triangles], begins)
    high[used] = np.maximum.reduceat(upper[triangles], begins)
    low, high = low.reshape(len(counts), _BINS, 3), high.reshape(len(counts), _BINS, 3)
    sizes = sizes.reshape(len(counts), _BINS)
    left, right = _costs(low, high, sizes), _costs(low[:, ::-1], high[:, ::-1], sizes[:, ::-1])[:, ::-1]
    cost = left[:, :-1] + right[:, 1:]
    best = np.argmin(cost, axis=1)
    lefts = np.cumsum(sizes, axis=1)[each, best]
    return np.where(np.isinf(cost[each, best]) | by_middle, counts // 2, lefts)


def _costs(low: Array, high: Array, sizes: np.ndarray) -> Array:
    """Half the surface of the first 1, 2, … bins times their number of triangles `(nodes, bins)`; infinite if empty."""
    spans = np.maximum.accumulate(high, axis=1) - np.minimum.accumulate(low, axis=1)
    totals = np.cumsum(sizes, axis=1)
    x, y, z = np.moveaxis(np.where(totals[..., None] > 0, spans, 0.0), -1, 0)
    return np.where(totals > 0, totals * (x * y + y * z + z * x), np.inf)


def build_bvh(vertices: Array, faces: np.ndarray) -> Bvh:
    """Build the tree of a closed, consistently wound mesh: vertices `(V, 3)` in metres, faces `(F, 3)`."""
    corners = np.ascontiguousarray(vertices, dtype=np.float64)[faces]
    boxes, links, order = _order_triangles(corners)
    return Bvh(boxes, links, corners[order], pseudo_normals(vertices, faces)[order])


def pseudo_normals(vertices: Array, faces: np.ndarray) -> Array:
    """Angle-weighted pseudo-normals `(F, 7, 3)` of each face: its own, of its edges 01, 12, 20, of its corners."""
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


@inner
def _closest_on_triangle(px: float, py: float, pz: float, t: Array, f):
    """Closest point of the triangle `t[f]` of `t (F, 3, 3)`: coordinates and region (0 face, 1-3 edges, 4-6 corners).

    Source: Ericson, Real-Time Collision Detection, section 5.1.5.
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


@inner
def _box_distance_squared(boxes: Array, node, px: float, py: float, pz: float):
    x = max(boxes[node, 0] - px, 0.0, px - boxes[node, 3])
    y = max(boxes[node, 1] - py, 0.0, py - boxes[node, 4])
    z = max(boxes[node, 2] - pz, 0.0, pz - boxes[node, 5])
    return x * x + y * y + z * z


@inner
def closest_point(bvh: Bvh, px: float, py: float, pz: float, seed):
    """The point of the mesh that is closest to a query point; `seed` is a triangle guessed to be near, or -1.

    Returns `(signed distance, cx, cy, cz, triangle, region)`; the distance is negative inside.
    """
    boxes, links, corners, normals = bvh.boxes, bvh.links, bvh.corners, bvh.normals
    best, bx, by, bz, triangle, region = np.inf, 0.0, 0.0, 0.0, -1, 0
    if seed >= 0:
        bx, by, bz, region = _closest_on_triangle(px, py, pz, corners, seed)
        best = (px - bx) ** 2 + (py - by) ** 2 + (pz - bz) ** 2
        triangle = seed
    stack, near = _nodes(), _numbers()
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


@inner
def trace_ray(bvh: Bvh, ox: float, oy: float, oz: float, dx: float, dy: float, dz: float):
    """First hit of one ray: the distance along the unit direction, `inf` without a hit, and the triangle.

    Source: Möller and Trumbore 1997.
    """
    ix = 1.0 / dx if dx != 0.0 else np.inf
    iy = 1.0 / dy if dy != 0.0 else np.inf
    iz = 1.0 / dz if dz != 0.0 else np.inf
    best, triangle = np.inf, -1
    stack = _nodes()
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


@inner
def _box_along(box: Array, x: float, y: float, z: float):
    """The least that a point of a box `(6,)` can reach along a direction."""
    at = x * (box[0] if x > 0.0 else box[3]) + y * (box[1] if y > 0.0 else box[4])
    return at + z * (box[2] if z > 0.0 else box[5])


@inner
def least_along(bvh: Bvh, direction: Array):
    """The least component of a corner along `direction (3,)`, metres, by a walk down the tree, nearest boxes first."""
    x, y, z = direction[0], direction[1], direction[2]
    least, nodes, waiting = np.inf, _nodes(), 1
    nodes[0] = 0
    while waiting > 0:
        waiting -= 1
        node = nodes[waiting]
        if _box_along(bvh.boxes[node], x, y, z) >= least:
            continue
        start, count = bvh.links[node]
        for triangle in range(start, start + count):
            for k in range(3):
                corner = bvh.corners[triangle, k]
                least = min(least, x * corner[0] + y * corner[1] + z * corner[2])
        if count == 0:
            left, right = start, start + 1
            nearer = _box_along(bvh.boxes[left], x, y, z) < _box_along(bvh.boxes[right], x, y, z)
            nodes[waiting], nodes[waiting + 1] = (right, left) if nearer else (left, right)
            waiting += 2
    return least
