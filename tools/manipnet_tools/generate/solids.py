"""Closed meshes together with the convex pieces that fill them, in millimetres, Y up.

A simulator collides convex bodies only. Because each solid is built from its pieces, none has to be decomposed later,
which takes minutes for a mesh.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import manifold3d as _  # noqa: F401  trimesh's unions need it, and say so only when one is made
import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh import Trimesh

from manipnet.geometry import Array
from manipnet_tools.assets.objects import lathe, refined, rounded, subdivided, turns

SECTIONS: Final = 32
SECTORS: Final = 10
"""A hollow wall is divided into this many pieces around its axis."""
BANDS: Final = 9
"""A curved profile is divided into this many pieces along its axis at most."""
LONGEST_EDGE_MM: Final = 12.0


@dataclass(frozen=True, eq=False)
class Site:
    """A place made to be held: `point (3,)` on the middle line of a bar or rim, the direction `along (3,)` of that line
    and `out (3,)`, at right angles to it, toward the hand. `radius` is half of the thickness."""

    kind: str
    """bar, stick, rim or knob. A stick may be held from all around, a bar from `out` only."""
    point: Array
    along: Array
    out: Array
    radius: float


@dataclass(frozen=True, eq=False)
class Solid:
    """A closed mesh, the points `(n, 3)` of its convex pieces, and where it may be held."""

    mesh: Trimesh
    pieces: tuple[Array, ...]
    sites: tuple[Site, ...] = ()

    def moved(self, matrix: Array) -> "Solid":
        """The solid under a rigid motion, a 4 × 4 matrix."""
        turn, shift = matrix[:3, :3], matrix[:3, 3]
        sites = tuple(
            replace(s, point=turn @ s.point + shift, along=turn @ s.along, out=turn @ s.out) for s in self.sites
        )
        return Solid(self.mesh.copy().apply_transform(matrix), tuple(p @ turn.T + shift for p in self.pieces), sites)

    def scaled(self, factors: Array) -> "Solid":
        """The solid stretched along its axes, without its sites."""
        mesh = self.mesh.copy()
        mesh.vertices = mesh.vertices * factors
        return Solid(mesh, tuple(piece * factors for piece in self.pieces))


def union(solids: Sequence[Solid]) -> Solid:
    """Solids that overlap, as one closed mesh."""
    mesh = trimesh.boolean.union([solid.mesh for solid in solids])
    return Solid(mesh, sum((s.pieces for s in solids), ()), sum((s.sites for s in solids), ()))


def convex(points: Array) -> Solid:
    """The hull of points, with triangles small enough to be bent by nothing and felt everywhere."""
    hull = trimesh.convex.convex_hull(points)
    vertices, faces = trimesh.remesh.subdivide_to_size(hull.vertices, hull.faces, LONGEST_EDGE_MM, max_iter=12)[:2]
    mesh = Trimesh(vertices, faces)
    mesh.merge_vertices()
    return Solid(mesh if mesh.is_watertight else hull, (np.asarray(hull.vertices),))


def box(size: Sequence[float] | NDArray) -> Solid:
    """A box about the origin."""
    mesh = trimesh.creation.box(size)
    times = int(np.clip(np.ceil(np.log2(max(size) / LONGEST_EDGE_MM)), 0, 4))
    return Solid(subdivided(mesh, times), (np.asarray(mesh.vertices),))


def turned(outer: NDArray, inner: NDArray | None = None, corner: float = 1.5) -> Solid:
    """A solid of revolution about Y; `outer` and `inner` are lines of (radius, height), both rising.

    `inner` is the cavity, from its bottom on the axis to the rim, where it meets the end of `outer`.
    """
    start, end = [(0.0, outer[0, 1])], [(0.0, outer[-1, 1])]
    if inner is None:
        line = rounded([*start, *outer, *end], corner)
        return Solid(_revolved(line), tuple(_disc(band) for band in _bands(outer)))
    line = rounded([*start, *outer, *inner[::-1]], corner)
    bottom = inner[0, 1]
    solid = [band for band in _bands(_between(outer, outer[0, 1], bottom))]
    heights = np.linspace(bottom, outer[-1, 1], BANDS)
    walls = []
    for low, high in pairwise(heights):
        rings = [(_radius(line_, y), y) for y in (low, high) for line_ in (outer, inner)]
        walls += [_sector(rings, k) for k in range(SECTORS)]
    return Solid(_revolved(line), (*(_disc(band) for band in solid), *walls))


def tube(path: Array, thickness: NDArray, width: NDArray, normal: Array, closed: bool = False) -> Solid:
    """A bar of elliptic section along `path (n, 3)`: `thickness (n,)` in its plane, `width (n,)` along `normal`."""
    along = np.roll(path, -1, 0) - np.roll(path, 1, 0) if closed else np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(normal, along)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    up = np.cross(along, across)
    circle = turns(16)
    rings = path[:, None] + 0.5 * (
        thickness[:, None, None] * circle[:, :1] * across[:, None] + width[:, None, None] * circle[:, 1:] * up[:, None]
    )
    count, points = len(path), len(circle)
    near = np.arange(count * points).reshape(count, points)
    far = np.roll(near, -1, axis=0)
    if not closed:
        near, far = near[:-1], far[:-1]
    a, b, c, d = near, np.roll(near, -1, axis=1), far, np.roll(far, -1, axis=1)
    faces = [np.stack([a, b, c, c, b, d], axis=-1).reshape(-1, 3)]
    if not closed:
        last = (count - 1) * points
        faces.append(np.array([(0, k + 1, k) for k in range(1, points - 1)]))
        faces.append(np.array([(last, last + k, last + k + 1) for k in range(1, points - 1)]))
    mesh = Trimesh(rings.reshape(-1, 3), np.concatenate(faces), process=False)
    if mesh.volume < 0.0:
        mesh.invert()
    step = 2 if count > 12 else 1
    cuts = [*range(0, count, step), *([] if closed else [count - 1])]
    pairs = zip(cuts, [*cuts[1:], cuts[0]] if closed else cuts[1:], strict=False)
    pieces = tuple(np.concatenate([rings[i], rings[j]]) for i, j in pairs if i != j)
    return Solid(mesh, pieces)


def _revolved(line: NDArray) -> Trimesh:
    return lathe(line, sections=SECTIONS)


def _bands(outer: NDArray) -> list[NDArray]:
    """The line in parts that bulge outward, whose discs are convex."""
    if len(outer) < 2:
        return []
    fine = refined(outer)
    heights = np.linspace(fine[0, 1], fine[-1, 1], min(BANDS, max(len(fine), 2)))
    points = np.array([(_radius(outer, y), y) for y in heights])
    bands, first = [], 0
    for k in range(1, len(points) - 1):
        slopes = np.diff(points[k - 1 : k + 2, 0]) / np.maximum(np.diff(points[k - 1 : k + 2, 1]), 1e-9)
        if slopes[1] > slopes[0] + 0.02:
            bands.append(points[first : k + 1])
            first = k
    return [*bands, points[first:]]


def _between(line: NDArray, low: float, high: float) -> NDArray:
    inside = line[(line[:, 1] > low) & (line[:, 1] < high)]
    return np.array([(_radius(line, low), low), *inside, (_radius(line, high), high)])


def _radius(line: NDArray, height: float) -> float:
    order = np.argsort(line[:, 1], kind="stable")
    return float(np.interp(height, line[order, 1], line[order, 0]))


def _disc(band: NDArray) -> Array:
    circle = turns(20)
    return np.concatenate([np.c_[r * circle[:, 0], np.full(20, y), r * circle[:, 1]] for r, y in band])


def _sector(rings: list[tuple[float, float]], number: int) -> Array:
    angles = 2.0 * np.pi / SECTORS * (number + np.linspace(0.0, 1.0, 4))
    return np.concatenate([np.c_[r * np.cos(angles), np.full(4, y), -r * np.sin(angles)] for r, y in rings])
