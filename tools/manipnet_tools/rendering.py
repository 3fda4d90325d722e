"""Renders hands and objects without a display or GPU, with Embree rays, three lights and soft occlusion.

A scene is a list of `PaintedMesh` in one right-handed, Y-up frame in metres. `render` draws one view, and
`contact_sheet` lays several beside each other. It needs embreex and Pillow (extra `train`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import Array

Image = NDArray[np.uint8]

SKIN_RIGHT = (0.80, 0.52, 0.40)
SKIN_LEFT = (0.72, 0.46, 0.40)
CERAMIC = (0.22, 0.42, 0.58)
_BACKGROUND = np.array([0.80, 0.82, 0.84])
_GROUND = np.array([0.56, 0.57, 0.58])
_GROUND_EXTENT_M = 6.0
_CREASE_COSINE = np.cos(np.radians(38.0))
_AMBIENT_RAYS = 10
_AMBIENT_REACH_M = 0.06
_LIGHTS = (
    # direction to the light in the camera's right/up/back frame, colour; the first casts shadows
    ((-0.45, 0.85, 0.55), (1.15, 1.10, 1.02)),
    ((0.90, 0.25, 0.60), (0.34, 0.37, 0.42)),
    ((0.25, 0.45, -0.85), (0.40, 0.42, 0.45)),
)


@dataclass(frozen=True)
class PaintedMesh:
    """A triangle mesh: `vertices (V, 3)`, `faces (F, 3)`, linear `color (3,)` or one per vertex `(V, 3)`."""

    vertices: Array
    faces: NDArray[np.int64]
    color: Array | tuple[float, float, float] = CERAMIC


@dataclass(frozen=True)
class Camera:
    """A pinhole camera at `eye` that looks at `target`, both `(3,)`; `fov` is the vertical field of view in radians."""

    eye: Array
    target: Array
    fov: float = 0.45

    @staticmethod
    def orbit(target: Array, distance: float, azimuth: float, elevation: float) -> "Camera":
        """A camera around `target`; angles in radians: azimuth 0 looks along -z, a quarter turn looks along -x."""
        flat = np.cos(elevation)
        out = np.array([flat * np.sin(azimuth), np.sin(elevation), flat * np.cos(azimuth)])
        return Camera(np.asarray(target) + distance * out, np.asarray(target))

    def axes(self) -> Array:
        """Rows: unit vectors to the right, up and backwards, `(3, 3)`."""
        back = (self.eye - self.target) / np.linalg.norm(self.eye - self.target)
        right = np.cross([0.0, 1.0, 0.0], back)
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(back, right), back])


def beads(points: Array, radius: float, color: tuple[float, float, float]) -> PaintedMesh:
    """Small balls at `points (n, 3)`."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=2, radius=radius)
    return _repeat(np.asarray(points)[:, None] + ball.vertices, ball.faces, color)


def rods(starts: Array, ends: Array, radius: float, color: tuple[float, float, float]) -> PaintedMesh:
    """Thin round bars from `starts (n, 3)` to `ends (n, 3)`."""
    import trimesh

    along = np.asarray(ends) - np.asarray(starts)
    length = np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    w = along / length
    u = np.cross(w, np.eye(3)[np.argmin(np.abs(w), axis=1)])
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    frames = np.stack([u, np.cross(w, u), w], axis=1)
    bar = trimesh.creation.cylinder(radius=1.0, height=1.0, sections=10)
    stretch = np.concatenate([np.full((len(length), 2), radius), length], axis=1)
    local = (bar.vertices + np.array([0.0, 0.0, 0.5])) * stretch[:, None]
    return _repeat(np.asarray(starts)[:, None] + local @ frames, bar.faces, color)


def render(
    meshes: Sequence[PaintedMesh], camera: Camera, size: tuple[int, int] = (800, 600), floor_y: float | None = None
) -> Image:
    """Draw one view of `size` (width, height) as `(height, width, 3)`; `floor_y` adds a ground plane at this height."""
    if floor_y is not None:
        meshes = [*meshes, _ground(camera.target, floor_y)]
    scene = _RayScene(meshes, ground=floor_y is not None)
    rows = camera.axes()
    plane = 2.0 * np.tan(0.5 * camera.fov)
    width, height = size
    fine = 2  # samples per pixel edge
    x = ((np.arange(fine * width) + 0.5) / (fine * width) - 0.5) * plane * width / height
    y = (0.5 - (np.arange(fine * height) + 0.5) / (fine * height)) * plane
    directions = x[None, :, None] * rows[0] + y[:, None, None] * rows[1] - rows[2]
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    colors = scene.shade(camera.eye, directions.reshape(-1, 3), rows)
    colors = colors.reshape(height, fine, width, fine, 3).mean(axis=(1, 3))
    return (255.0 * np.clip(colors, 0.0, 1.0) ** (1 / 2.2) + 0.5).astype(np.uint8)


def contact_sheet(images: Sequence[Image], columns: int) -> Image:
    """Images of one size side by side, row by row."""
    height, width, _ = images[0].shape
    rows = -(-len(images) // columns)
    sheet = np.full((rows * height, columns * width, 3), 255, dtype=np.uint8)
    for i, image in enumerate(images):
        top, left = (i // columns) * height, (i % columns) * width
        sheet[top : top + height, left : left + width] = image
    return sheet


def save_png(image: Image, path: Path | str) -> None:
    """Write `(height, width, 3)` to a PNG file."""
    from PIL import Image as Pillow

    Pillow.fromarray(image).save(path)


class _RayScene:
    """The triangles of all meshes in one Embree scene, with a normal and a colour at every corner."""

    def __init__(self, meshes: Sequence[PaintedMesh], ground: bool):
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        corners, normals, colors = [], [], []
        for mesh in meshes:
            faces = np.asarray(mesh.faces)
            corners.append(np.asarray(mesh.vertices, dtype=np.float64)[faces])
            normals.append(corner_normals(np.asarray(mesh.vertices), faces))
            colors.append(np.broadcast_to(mesh.color, (len(mesh.vertices), 3))[faces])
        self._normals, self._colors = np.concatenate(normals), np.concatenate(colors)
        self._ground_from = len(self._normals) - (2 if ground else 0)
        self._rays = EmbreeScene()
        TriangleMesh(self._rays, np.ascontiguousarray(np.concatenate(corners), dtype=np.float32))

    def shade(self, eye: Array, directions: Array, rows: Array) -> Array:
        """Linear colours `(n, 3)` seen from `eye` along unit `directions (n, 3)`."""
        colors = np.tile(_BACKGROUND, (len(directions), 1))
        hit = self._trace(np.broadcast_to(eye, directions.shape), directions)
        seen = np.flatnonzero(hit["primID"] >= 0)
        face = hit["primID"][seen]
        u, v = hit["u"][seen, None], hit["v"][seen, None]
        weights = np.stack([1.0 - u - v, u, v], axis=1)
        normals = np.sum(weights * self._normals[face], axis=1)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        albedo = np.sum(weights * self._colors[face], axis=1)
        view = -directions[seen]
        points = eye - view * hit["tfar"][seen, None]
        normals *= np.sign(np.sum(normals * view, axis=1, keepdims=True) + 1e-12)
        start = points + 2e-4 * normals + 1e-4 * view
        light = self._ambient(start, normals) * (0.30 + 0.18 * normals[:, 1:2]) * np.array([0.95, 1.0, 1.06])
        gloss = np.zeros((len(seen), 1))
        for k, (toward, strength) in enumerate(_LIGHTS):
            to_light = np.array(toward) @ rows
            to_light /= np.linalg.norm(to_light)
            facing = np.maximum(normals @ to_light, 0.0)
            if k == 0:
                blocked = self._trace(start, np.broadcast_to(to_light, start.shape))["primID"] >= 0
                facing = np.where(blocked, 0.12 * facing, facing)
                half = view + to_light
                half /= np.linalg.norm(half, axis=1, keepdims=True)
                gloss = np.where(blocked, 0.0, np.sum(normals * half, axis=1).clip(0.0) ** 40)[:, None]
            light = light + facing[:, None] * np.array(strength)
        shaded = albedo * light * 0.85 + 0.10 * gloss
        fade = np.clip(np.linalg.norm(points - points.mean(axis=0), axis=1) / (0.35 * _GROUND_EXTENT_M), 0, 1)
        fade = np.where(face >= self._ground_from, fade, 0.0)[:, None]
        colors[seen] = (1.0 - fade) * shaded + fade * _BACKGROUND
        return colors

    def _ambient(self, points: Array, normals: Array) -> Array:
        """The share of the sky above each point that nothing near it covers, `(n, 1)`."""
        u = np.cross(normals, np.eye(3)[np.argmin(np.abs(normals), axis=1)])
        u /= np.linalg.norm(u, axis=1, keepdims=True)
        v = np.cross(normals, u)
        open_sky = np.zeros(len(points))
        for k in range(_AMBIENT_RAYS):
            sine = np.sqrt((k + 0.5) / _AMBIENT_RAYS)
            turn = 2.399963 * k  # golden angle
            ray = np.cos(turn) * sine * u + np.sin(turn) * sine * v + np.sqrt(1.0 - sine * sine) * normals
            open_sky += np.minimum(self._trace(points, ray)["tfar"] / _AMBIENT_REACH_M, 1.0)
        return (open_sky / _AMBIENT_RAYS)[:, None]

    def _trace(self, origins: Array, directions: Array) -> dict:
        return self._rays.run(
            np.ascontiguousarray(origins, dtype=np.float32),
            np.ascontiguousarray(directions, dtype=np.float32),
            output=1,
        )


def corner_normals(vertices: Array, faces: NDArray[np.int64]) -> Array:
    """A normal for each corner of each face, `(F, 3, 3)`: the mean of the faces there that no crease separates."""
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    area_normals = np.cross(b - a, c - a)
    unit = area_normals / np.maximum(np.linalg.norm(area_normals, axis=1, keepdims=True), 1e-20)
    order = np.argsort(faces, axis=None, kind="stable")
    counts = np.bincount(faces.ravel(), minlength=len(vertices))
    starts = np.cumsum(counts) - counts
    own_count = counts[faces.ravel()[order]]
    first = np.repeat(order, own_count)  # every pair of corners that share a vertex
    within = np.arange(len(first)) - np.repeat(np.cumsum(own_count) - own_count, own_count)
    second = order[np.repeat(starts[faces.ravel()[order]], own_count) + within]
    smooth = np.sum(unit[first // 3] * unit[second // 3], axis=1) > _CREASE_COSINE
    normals = np.zeros((faces.size, 3))
    for axis in range(3):
        contribution = area_normals[second[smooth] // 3, axis]
        normals[:, axis] = np.bincount(first[smooth], contribution, minlength=faces.size)
    normals += 1e-3 * np.repeat(unit, 3, axis=0) * np.linalg.norm(area_normals, axis=1).repeat(3)[:, None] + 1e-30
    return (normals / np.linalg.norm(normals, axis=1, keepdims=True)).reshape(len(faces), 3, 3)


def _ground(around: Array, floor_y: float) -> PaintedMesh:
    corners = np.array([(-1.0, 0.0, -1.0), (1.0, 0.0, -1.0), (1.0, 0.0, 1.0), (-1.0, 0.0, 1.0)])
    vertices = _GROUND_EXTENT_M * corners + [around[0], floor_y, around[2]]
    return PaintedMesh(vertices, np.array([(0, 2, 1), (0, 3, 2)]), tuple(_GROUND))


def _repeat(vertices: Array, faces: NDArray[np.int64], color: tuple[float, float, float]) -> PaintedMesh:
    """One mesh made of `n` copies of a mesh, `vertices (n, V, 3)`."""
    copies, per_copy, _ = vertices.shape
    all_faces = (np.asarray(faces)[None] + per_copy * np.arange(copies)[:, None, None]).reshape(-1, 3)
    return PaintedMesh(vertices.reshape(-1, 3), all_faces, color)
