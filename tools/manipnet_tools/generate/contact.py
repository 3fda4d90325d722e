"""Compiled functions that ask how near a hand is to an object. Points and normals are in the object's frame, metres.

They are in one file because the compiler's cache notices changes of a file, but not of the files that it uses.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from manipnet.common.kernel_compiler import KernelCompiler
from manipnet.geometry import Array
from manipnet.synthesis.hand.hand import Skeleton
from manipnet.synthesis.hand.kinematics import forward_kinematics_into
from manipnet.synthesis.objects.shape import Shape, _signed_distances

CELL_M = 0.0022
MARGIN_M = 0.03
SAMPLES = 5
"""Points of a capsule's axis at which its gap is measured."""
PALM_START = 0.3
"""Where the capsules of the palm begin, as a share of the way from the wrist to a knuckle."""
WANTED_GAP_M = -0.0008
"""The skin yields: a contact is this deep."""
DEPTH_M = 0.0016
"""Deeper contacts cost."""
_kernel = njit(nogil=True, error_model="numpy", pipeline_class=KernelCompiler)
"""As `manipnet.jit.kernel`, whose inner functions these call, but they may allocate."""
_inner = _kernel


class Space(NamedTuple):
    """Signed distances `(X, Y, Z)` to an object on a fine grid around it."""

    distance: NDArray[np.float32]
    low: Array
    cell_m: float


class Body(NamedTuple):
    """What the kernels know of a hand: its bones, and its capsules' ends and radii. The first four are the palm's."""

    skeleton: Skeleton
    starts: NDArray[np.int64]
    ends: NDArray[np.int64]
    radii: Array
    limits: Array


def space_around(shape: Shape) -> Space:
    """The distances around a shape."""
    low, high = shape.bounds[0] - MARGIN_M, shape.bounds[1] + MARGIN_M
    counts = np.ceil((high - low) / CELL_M).astype(int) + 1
    grid = np.stack(np.meshgrid(*(low[i] + CELL_M * np.arange(counts[i]) for i in range(3)), indexing="ij"), axis=-1)
    points = grid.reshape(-1, 3)
    distance, normal = np.empty(len(points)), np.empty((len(points), 3))
    _signed_distances(shape.bvh, shape.field, points, 2.0 * CELL_M, distance, normal)
    return Space(distance.reshape(counts).astype(np.float32), low, CELL_M)


def mirrored_space(space: Space) -> Space:
    """The distances around the mirror image of an object, x to -x."""
    high = space.low[0] + space.cell_m * (space.distance.shape[0] - 1)
    return Space(np.ascontiguousarray(space.distance[::-1]), np.array([-high, *space.low[1:]]), space.cell_m)


@_inner
def distance_at(space: Space, x: float, y: float, z: float):
    """Signed distance at a point; beyond the grid the way to it is added."""
    grid, low, cell = space.distance, space.low, space.cell_m
    u, v, w = (x - low[0]) / cell, (y - low[1]) / cell, (z - low[2]) / cell
    cu = min(max(u, 0.0), grid.shape[0] - 1.001)
    cv = min(max(v, 0.0), grid.shape[1] - 1.001)
    cw = min(max(w, 0.0), grid.shape[2] - 1.001)
    beyond = cell * np.sqrt((u - cu) ** 2 + (v - cv) ** 2 + (w - cw) ** 2)
    i, j, k = int(cu), int(cv), int(cw)
    a, b, c = cu - i, cv - j, cw - k
    near = (grid[i, j, k] * (1 - c) + grid[i, j, k + 1] * c) * (1 - b)
    near += (grid[i, j + 1, k] * (1 - c) + grid[i, j + 1, k + 1] * c) * b
    far = (grid[i + 1, j, k] * (1 - c) + grid[i + 1, j, k + 1] * c) * (1 - b)
    far += (grid[i + 1, j + 1, k] * (1 - c) + grid[i + 1, j + 1, k + 1] * c) * b
    return near * (1 - a) + far * a + beyond


@_kernel
def distance_of(space: Space, point: Array):
    """Signed distance at `point (3,)`, for callers that are not compiled."""
    return distance_at(space, point[0], point[1], point[2])


@_inner
def normal_at(space: Space, x: float, y: float, z: float, out: Array):
    """The direction away from the object's surface at a point, into `out (3,)`."""
    h = 0.0012
    out[0] = distance_at(space, x + h, y, z) - distance_at(space, x - h, y, z)
    out[1] = distance_at(space, x, y + h, z) - distance_at(space, x, y - h, z)
    out[2] = distance_at(space, x, y, z + h) - distance_at(space, x, y, z - h)
    length = np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2) + 1e-12
    for i in range(3):
        out[i] /= length


@_kernel
def score_rows(
    space: Space,
    turn: Array,
    place: Array,
    points: Array,
    radii: Array,
    pads: Array,
    wanted: Array,
    gaps: Array,
    scores: Array,
):
    """How well each row of a finger's table touches, into `gaps (R, 3)` and `scores (R,)`.

    `points (R, 3, S, 3)` are on the axes of the finger's capsules in the wrist frame and `pads (R, 3)` the direction of
    its pad; `wanted (3,)` is what a contact of each capsule is worth.
    """
    normal = np.empty(3)
    for r in range(len(points)):
        score = 0.0
        deepest = 0.0
        for c in range(3):
            least, px, py, pz = 1e9, 0.0, 0.0, 0.0
            for s in range(points.shape[2]):
                q = points[r, c, s]
                x = turn[0, 0] * q[0] + turn[0, 1] * q[1] + turn[0, 2] * q[2] + place[0]
                y = turn[1, 0] * q[0] + turn[1, 1] * q[1] + turn[1, 2] * q[2] + place[1]
                z = turn[2, 0] * q[0] + turn[2, 1] * q[1] + turn[2, 2] * q[2] + place[2]
                d = distance_at(space, x, y, z)
                if d < least:
                    least, px, py, pz = d, x, y, z
            gap = least - radii[c]
            gaps[r, c] = gap
            deepest = min(deepest, gap)
            touch = np.exp(-max(gap, 0.0) / 0.004)
            if c == 2 and touch > 0.3:
                normal_at(space, px, py, pz, normal)
                facing = 0.0
                for i in range(3):
                    pad = turn[i, 0] * pads[r, 0] + turn[i, 1] * pads[r, 1] + turn[i, 2] * pads[r, 2]
                    facing -= pad * normal[i]
                touch *= 0.25 + 0.75 * max(facing, -0.3)
            score += wanted[c] * touch
        if deepest < -DEPTH_M:
            score -= (-DEPTH_M - deepest) / 0.0012
        scores[r] = score


@_inner
def hand_gaps(
    space: Space,
    body: Body,
    angles: Array,
    turn: Array,
    place: Array,
    positions: Array,
    rotations: Array,
    axes: Array,
    gaps: Array,
    points: Array,
):
    """Gaps of all capsules `(C,)`, and the points of their axes that are nearest to the object `(C, 3)`.

    Returns how far the thumb's outer capsules are from those of the fingers.
    """
    forward_kinematics_into(body.skeleton, angles, positions, rotations, axes)
    for c in range(len(body.radii)):
        a, b, best = body.starts[c], body.ends[c], 1e9
        for s in range(SAMPLES):
            f = s / (SAMPLES - 1.0)
            if a == 0:
                f = PALM_START + (1.0 - PALM_START) * f
            p0 = positions[a, 0] + f * (positions[b, 0] - positions[a, 0])
            p1 = positions[a, 1] + f * (positions[b, 1] - positions[a, 1])
            p2 = positions[a, 2] + f * (positions[b, 2] - positions[a, 2])
            x = turn[0, 0] * p0 + turn[0, 1] * p1 + turn[0, 2] * p2 + place[0]
            y = turn[1, 0] * p0 + turn[1, 1] * p1 + turn[1, 2] * p2 + place[1]
            z = turn[2, 0] * p0 + turn[2, 1] * p1 + turn[2, 2] * p2 + place[2]
            d = distance_at(space, x, y, z)
            if d < best:
                best = d
                points[c, 0], points[c, 1], points[c, 2] = x, y, z
        gaps[c] = best - body.radii[c]
    return _clearance(body, positions)


@_inner
def _clearance(body: Body, positions: Array):
    """The smallest distance between capsules of different digits, metres; negative where they overlap."""
    least = 1e9
    for c in range(5, len(body.radii)):
        for e in range(c + 1, len(body.radii)):
            if (c - 4) // 3 == (e - 4) // 3:
                continue
            for s in range(3):
                for q in range(3):
                    far = 0.0
                    for i in range(3):
                        u = positions[body.starts[c], i] + 0.5 * s * (
                            positions[body.ends[c], i] - positions[body.starts[c], i]
                        )
                        u -= positions[body.starts[e], i] + 0.5 * q * (
                            positions[body.ends[e], i] - positions[body.starts[e], i]
                        )
                        far += u * u
                    least = min(least, np.sqrt(far) - body.radii[c] - body.radii[e])
    return least


@_kernel
def look(space: Space, body: Body, angles: Array, turn: Array, place: Array):
    """Gaps `(C,)`, axis points and normals `(C, 3)`, and the clearance between digits."""
    count = len(body.radii)
    positions, rotations, axes = np.empty((32, 3)), np.empty((32, 3, 3)), np.empty((32, 3))
    gaps, points, normals = np.empty(count), np.empty((count, 3)), np.empty((count, 3))
    clear = hand_gaps(space, body, angles, turn, place, positions, rotations, axes, gaps, points)
    for c in range(count):
        normal_at(space, points[c, 0], points[c, 1], points[c, 2], normals[c])
    return gaps, points, normals, clear


@_kernel
def settle(space: Space, body: Body, start: Array, turn: Array, place: Array, wanted: Array, stiff: Array, rounds: int):
    """Move fingers and wrist a little, so that the capsules that are `wanted (C,)` touch and none is deep.

    Damped Gauss-Newton steps on the angles, a rotation and a translation. Each stays near its start, the more the
    `stiff`er it is `(A + 6,)`; end joints bend with middle ones, and neighbours alike. Returns angles `(A,)`, rotation
    and translation of the wrist.
    """
    angle_count, count = len(start), len(body.radii)
    size = angle_count + 6
    rows = 2 * count + 1 + size + 4 + 3
    positions, rotations, axes = np.empty((32, 3)), np.empty((32, 3, 3)), np.empty((32, 3))
    gaps, points = np.empty(count), np.empty((count, 3))
    x = np.zeros(size)
    x[:angle_count] = start
    jacobian, here, there = np.empty((rows, size)), np.empty(rows), np.empty(rows)
    skew, turned, placed = np.eye(3), np.empty((3, 3)), np.empty(3)
    for _ in range(rounds):
        for v in range(-1, size):
            y = x.copy()
            step = 2e-4 if v >= size - 3 else 2e-3
            if v >= 0:
                y[v] += step
            a, b, c = y[angle_count], y[angle_count + 1], y[angle_count + 2]
            skew[0, 1], skew[0, 2], skew[1, 0], skew[1, 2], skew[2, 0], skew[2, 1] = -c, b, c, -a, -b, a
            turned[:] = turn @ skew  # first order is exact enough for the few degrees that are allowed
            placed[:] = place + y[angle_count + 3 :]
            clear = hand_gaps(space, body, y[:angle_count], turned, placed, positions, rotations, axes, gaps, points)
            row = here if v < 0 else there
            m = 0
            for k in range(count):
                off = gaps[k] - WANTED_GAP_M
                row[m] = wanted[k] * 2.5 * off / np.sqrt(off * off + 0.004**2)
                row[m + 1] = min(gaps[k] + DEPTH_M, 0.0) / 0.0005
                m += 2
            row[m] = min(clear + 0.0015, 0.0) / 0.001
            m += 1
            for k in range(angle_count):
                row[m] = stiff[k] * (y[k] - start[k])
                m += 1
            for k in range(6):
                row[m] = stiff[angle_count + k] * y[angle_count + k]
                m += 1
            for f in range(4):
                row[m] = (y[7 + 4 * f] - 0.67 * y[6 + 4 * f]) / 0.2
                m += 1
            for f in range(3):
                row[m] = (y[4 + 4 * f] - y[8 + 4 * f]) / 0.5
                m += 1
            if v >= 0:
                jacobian[:, v] = (there - here) / step
        normal = jacobian.T @ jacobian
        for k in range(size):
            normal[k, k] += 1e-3 * normal[k, k] + 1e-6
        move = np.linalg.solve(normal, -(jacobian.T @ here))
        for k in range(size):
            x[k] += min(max(move[k], -0.15), 0.15)
        for k in range(angle_count):
            x[k] = min(max(x[k], body.limits[k, 0]), body.limits[k, 1])
    return x
