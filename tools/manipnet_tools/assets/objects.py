"""Generate the library of objects that the server ships: `python -m manipnet_tools.assets.objects`.

Meshes are built in millimetres, Y up, with the origin where a hand closes around them, and stored in metres. It needs
manifold3d (extra `train`) for the unions.
"""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from trimesh import Trimesh

from manipnet.synthesis.objects.library import LIBRARY_FOLDER

SEGMENTS = 56
EDGE_MM = 9.0

Point = tuple[float, float]
Line = NDArray[np.float64]


def main() -> None:
    """Write the mesh of every object."""
    for name, shape in SHAPES.items():
        mesh = shape()
        write_ply(LIBRARY_FOLDER / f"{name}.ply", 1e-3 * mesh.vertices, mesh.faces)


def write_ply(path: Path, vertices: NDArray, faces: NDArray) -> None:
    """Write a triangle mesh as little-endian PLY with float32 vertices."""
    rows = np.empty(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path.write_bytes(header.encode() + vertices.astype("<f4").tobytes() + rows.tobytes())


def cube() -> Trimesh:
    """Edge 60 mm."""
    return subdivided(trimesh.creation.box((60.0, 60.0, 60.0)), 3)


def cylinder() -> Trimesh:
    """Diameter 60 mm, height 80 mm."""
    return lathe([(0, -40), (30, -40), (30, 40), (0, 40)])


def sphere() -> Trimesh:
    """Diameter 70 mm, an icosahedral grid."""
    return trimesh.creation.icosphere(subdivisions=4, radius=35.0)


def torus() -> Trimesh:
    """A ring of radius 42 mm from a tube of radius 13 mm, lying flat."""
    return upright(trimesh.creation.torus(42.0, 13.0, major_sections=64, minor_sections=28))


def prism() -> Trimesh:
    """Equilateral triangle of edge 70 mm, 100 mm tall."""
    corners = 70.0 / np.sqrt(3.0) * turns(3)
    return subdivided(trimesh.convex.convex_hull(np.array([(x, y, z) for x, z in corners for y in (-50.0, 50.0)])), 3)


def tetrahedron() -> Trimesh:
    """Regular, edge 90 mm, standing on a face, origin at its centre."""
    inradius = 90.0 / np.sqrt(24.0)
    base = [(x, -inradius, z) for x, z in 90.0 / np.sqrt(3.0) * turns(3)]
    return subdivided(trimesh.convex.convex_hull(np.array([*base, (0.0, 3.0 * inradius, 0.0)])), 4)


def hemisphere() -> Trimesh:
    """Radius 45 mm, flat side down, origin at its centroid, 3/8 of the radius above the flat side."""
    angles = np.linspace(0.0, np.pi / 2.0, 16)
    arc = 45.0 * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    arc[-1, 0] = 0.0
    return lathe(np.vstack([(0.0, 0.0), arc]) - (0.0, 45.0 * 3.0 / 8.0))


def mug() -> Trimesh:
    """Diameter 82 mm, height 95 mm, walls 4.5 mm, a handle on the +x side; origin on the axis at half height."""
    body = [(0, -47.5), (41, -47.5), (41, 47.5), (36.5, 47.5), (36.5, -42), (0, -42)]
    bow = curve([(39, 27), (56, 31), (70, 20), (74, 0), (69, -17), (55, -28), (39, -31)], 20)
    return trimesh.boolean.union([lathe(rounded(body, 2.0)), bar(bow, thickness=11.0, width=16.0)])


def bottle() -> Trimesh:
    """Diameter 68 mm, height 216 mm, closed and without a cavity; origin on the axis at half the body's height."""
    side = curve([(34, -64), (34, 0), (34, 64), (31, 82), (20, 108), (14.5, 124), (14, 148)], 28)
    return lathe(rounded([(0, -68), (34, -68), *side, (0, 148)], 3.0))


def bowl() -> Trimesh:
    """Diameter 140 mm, height 62 mm, walls 5 mm; origin on the axis at half height."""
    outer = curve([(30, -31), (46, -22), (61, 0), (70, 31)], 14)
    inner = curve([(65, 31), (56, 1), (42, -18), (0, -24)], 14)
    return lathe(rounded([(0, -31), *outer, *inner], 2.0))


def hammer() -> Trimesh:
    """Length 300 mm along Y, a head of 110 mm along Z; origin on the handle where it is held."""
    grip = curve([(12, -95), (15.5, -80), (14, -40), (15, 0), (13, 50), (10.5, 120), (10.5, 190)], 20)
    handle = lathe(rounded([(0, -95), *grip, (0, 190)], 3.0), sections=40).apply_scale((0.8, 1.0, 1.15))
    face = lathe(rounded([(0, 5), (11, 5), (11, 45), (16, 49), (16, 66), (0, 66)], 1.5), sections=40)
    peen = lathe(rounded([(0, -44), (4, -44), (10.5, -20), (10.5, -5), (0, -5)], 1.5), sections=40)
    eye = subdivided(trimesh.creation.box((26.0, 44.0, 28.0)), 2)
    head = trimesh.boolean.union([face, peen, eye])
    head.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2.0, (1.0, 0.0, 0.0)))
    return trimesh.boolean.union([handle, head.apply_translation((0.0, 180.0, 0.0))])


def wine_glass() -> Trimesh:
    """Height 190 mm, bowl of 78 mm, foot of 70 mm; origin on the axis at half height."""
    outer = curve([(14, -89.5), (4.5, -80), (4, -40), (5.5, -16), (24, 0), (37, 28), (39, 48), (33, 95)], 30)
    inner = curve([(30.5, 95), (36.2, 48), (34, 28), (21, 4), (0, -7)], 16)
    return lathe(rounded([(0, -95), (35, -95), (35, -92), *outer, *inner], 1.0), sections=44)


def lathe(profile: Sequence[Point] | Line, sections: int = SEGMENTS) -> Trimesh:
    """The surface of revolution about Y of a line of (radius, height), from axis to axis and upward on its outside."""
    return upright(trimesh.creation.revolve(refined(np.array(profile, dtype=np.float64)), sections=sections))


def bar(path: Line, thickness: float, width: float) -> Trimesh:
    """A bar of elliptic section along a line in the plane z = 0, `width` along z, closed at its ends."""
    along = np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.stack([along[:, 1], -along[:, 0]], axis=-1)
    x, z = (0.5 * thickness * turns(20)[:, 0], 0.5 * width * turns(20)[:, 1])
    rings = np.concatenate(
        [path[:, None] + across[:, None] * x[:, None], np.tile(z, (len(path), 1))[..., None]], axis=-1
    )
    count = len(z)
    near = np.arange(len(path) * count).reshape(len(path), count)
    a, b = near[:-1], np.roll(near, -1, axis=1)[:-1]
    c, d = near[1:], np.roll(near, -1, axis=1)[1:]
    side = np.stack([a, b, c, c, b, d], axis=-1).reshape(-1, 3)
    ends = [(near[0, 0], near[0, k + 1], near[0, k]) for k in range(1, count - 1)]
    ends += [(near[-1, 0], near[-1, k], near[-1, k + 1]) for k in range(1, count - 1)]
    mesh = Trimesh(rings.reshape(-1, 3), np.vstack([side, ends]))
    if mesh.volume < 0.0:
        mesh.invert()
    return mesh


def upright(mesh: Trimesh) -> Trimesh:
    """A mesh with Z up, turned so that Y is up."""
    return mesh.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2.0, (1.0, 0.0, 0.0)))


def subdivided(mesh: Trimesh, times: int) -> Trimesh:
    """Every triangle split into four, this many `times`."""
    return mesh.subdivide(iterations=times)


def turns(count: int) -> Line:
    """Points on the unit circle, `(count, 2)`."""
    angles = 2.0 * np.pi * np.arange(count) / count
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def curve(knots: Sequence[Point], count: int) -> Line:
    """Points `(count, 2)` along a curve through the knots that does not overshoot them."""
    points = np.array(knots, dtype=np.float64)
    along = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
    return PchipInterpolator(along, points)(np.linspace(0.0, along[-1], count))


def rounded(line: Sequence[Point | NDArray], radius: float) -> Line:
    """The line with its sharp corners (over 40 degrees) replaced by short arcs; its ends remain."""
    points = np.array(line, dtype=np.float64)
    result = [points[:1]]
    for before, corner, after in zip(points, points[1:], points[2:], strict=False):
        u, v = before - corner, after - corner
        short = min(radius, 0.45 * np.linalg.norm(u), 0.45 * np.linalg.norm(v))
        u, v = u / np.linalg.norm(u), v / np.linalg.norm(v)
        if u @ v < -np.cos(np.radians(40.0)):
            result.append(corner[None])
            continue
        t = np.linspace(0.0, 1.0, 4)[:, None]
        result.append(corner + short * ((1 - t) ** 2 * u + t**2 * v))
    return np.vstack([*result, points[-1:]])


def refined(line: Line) -> Line:
    """The line with steps of at most `EDGE_MM`."""
    pieces = []
    for a, b in pairwise(line):
        steps = max(int(np.ceil(np.linalg.norm(b - a) / EDGE_MM)), 1)
        pieces.append(a + (b - a) * (np.arange(steps) / steps)[:, None])
    return np.vstack([*pieces, line[-1:]])


SHAPES = {
    shape.__name__: shape
    for shape in (
        *(cube, cylinder, sphere, torus, prism, tetrahedron, hemisphere),
        *(mug, bottle, bowl, hammer, wine_glass),
    )
}

if __name__ == "__main__":
    main()
