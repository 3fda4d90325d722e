"""Small repairs that close a nearly closed triangle mesh, on plain index arrays."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components

from manipnet.synthesis.objects.shells import nesting_depths

Vertices = NDArray[np.float64]
Faces = NDArray[np.int32]

_WELD = 1e-6
"""Vertices nearer to each other than this, relative to the mesh's size, are merged."""
_MAX_HOLE = 0.25
"""A wider opening, relative to the mesh's size, belongs to the shape (a vessel without walls) and is not a flaw."""


@dataclass(frozen=True)
class Edges:
    """The undirected edges of some faces."""

    ends: NDArray[np.int32]
    """`(E, 2)` the two vertices of each, the lower one first."""
    of_half: NDArray[np.intp]
    """`(3 F,)` the edge of each half-edge."""
    forward: NDArray[np.bool_]
    """`(3 F,)` whether the half-edge runs from the lower vertex to the higher one."""
    uses: NDArray[np.intp]
    """`(E,)` the number of half-edges of each."""


def mesh_edges(faces: Faces) -> Edges:
    """Edges of `faces` `(F, 3)`; half-edge `3 f + k` runs from corner k of face f to the next one."""
    half = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    ends, of_half, uses = np.unique(np.sort(half, axis=1), axis=0, return_inverse=True, return_counts=True)
    return Edges(ends, of_half.reshape(-1), half[:, 0] < half[:, 1], uses)


def is_closed(faces: Faces) -> bool:
    """Whether every edge belongs to exactly two faces."""
    return len(faces) >= 4 and bool(np.all(mesh_edges(faces).uses == 2))


def is_consistent(faces: Faces) -> bool:
    """Whether no two half-edges run along an edge in the same direction."""
    half = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    return len(np.unique(half, axis=0)) == len(half)


def weld(vertices: Vertices, faces: Faces) -> tuple[Vertices, Faces]:
    """Merge vertices at the same place, and drop the faces and vertices that become superfluous."""
    size = max(float(np.ptp(vertices, axis=0).max()), 1e-12)
    _, first, to = np.unique(np.round(vertices / (_WELD * size)), axis=0, return_index=True, return_inverse=True)
    return compact(vertices[first], to.reshape(-1)[faces].astype(np.int32))


def compact(vertices: Vertices, faces: Faces) -> tuple[Vertices, Faces]:
    """Drop faces with a repeated corner, repeated faces, and vertices that no face uses."""
    corners = np.sort(faces, axis=1)
    distinct = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2])
    faces, corners = faces[distinct], corners[distinct]
    faces = faces[np.sort(np.unique(corners, axis=0, return_index=True)[1])]
    used, to = np.unique(faces, return_inverse=True)
    return vertices[used], to.reshape(-1, 3).astype(np.int32)


def agree(faces: Faces) -> Faces:
    """Turn faces so that neighbours agree, which leaves open whether they face outward."""
    return faces if is_consistent(faces) else _agree(faces)


def orient(vertices: Vertices, faces: Faces) -> Faces:
    """Turn the shells of a closed mesh: outward, but those of cavities inward, and solids in cavities outward again.

    A shell that lies inside an odd number of others is a cavity. Faces that are right already stay as they are.
    """
    faces = agree(faces)
    count, part = connected_components(_adjacency(faces)[0], directed=False)
    volumes = np.bincount(part, weights=_face_volumes(vertices, faces))
    wanted = np.ones(count)
    if count > 1:
        wanted[nesting_depths(vertices, faces, part) % 2 == 1] = -1.0
    wrong = volumes * wanted < 0.0
    return np.where(wrong[part][:, None], faces[:, ::-1], faces).astype(np.int32) if wrong.any() else faces


def drop_debris(vertices: Vertices, faces: Faces) -> tuple[Vertices, Faces]:
    """Drop connected parts that enclose almost no volume, such as a stray triangle whose hole was filled."""
    _, part = connected_components(_adjacency(faces)[0], directed=False)
    volume = np.abs(np.bincount(part, weights=_face_volumes(vertices, faces)))
    return compact(vertices, faces[(volume > 1e-6 * volume.sum())[part]])


def signed_volume(vertices: Vertices, faces: Faces) -> float:
    """The enclosed volume; it is positive if the faces turn counter-clockwise seen from outside."""
    return float(_face_volumes(vertices, faces).sum())


def fill_small_holes(vertices: Vertices, faces: Faces) -> tuple[Vertices, Faces]:
    """Close each simple opening of at most a quarter of the mesh's size by a fan around its centre."""
    edges = mesh_edges(faces)
    half = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    rim = half[edges.uses[edges.of_half] == 1]
    if len(rim) != len(np.unique(rim[:, 0])):
        return vertices, faces  # openings touch in a point, so it is unclear which rim goes where
    following = dict(zip(rim[:, 0].tolist(), rim[:, 1].tolist(), strict=True))
    width = _MAX_HOLE * float(np.ptp(vertices, axis=0).max())
    for loop in _loops(following):
        corners = vertices[loop]
        if np.ptp(corners, axis=0).max() > width:
            continue
        centre = len(vertices)
        fan = [(b, a, centre) for a, b in zip(loop, loop[1:] + loop[:1], strict=True)]
        vertices = np.vstack([vertices, corners.mean(axis=0)])
        faces = np.vstack([faces, np.array(fan, dtype=np.int32)])
    return vertices, faces


def _loops(following: dict[int, int]) -> list[list[int]]:
    loops = []
    while following:
        start, at = following.popitem()
        loop = [start]
        while at != start and at in following:
            loop.append(at)
            at = following.pop(at)
        if at == start:
            loops.append(loop)
    return loops


def _face_volumes(vertices: Vertices, faces: Faces) -> NDArray[np.float64]:
    a, b, c = (vertices[faces[:, k]] - vertices.mean(axis=0) for k in range(3))
    return np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0


def _adjacency(faces: Faces) -> tuple[csr_matrix, csr_matrix]:
    """Two matrices `(F, F)` over pairs of faces that share an edge: ones; and 2 where the two disagree, 1 elsewhere."""
    edges = mesh_edges(faces)
    order = np.argsort(edges.of_half, kind="stable")
    order = order[edges.uses[edges.of_half[order]] == 2].reshape(-1, 2)
    a, b = order.T // 3
    same = edges.forward[order[:, 0]] == edges.forward[order[:, 1]]
    shape = (len(faces), len(faces))
    graph = csr_matrix((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=shape)
    weight = np.tile(np.where(same, 2.0, 1.0), 2)
    return graph, csr_matrix((weight, (np.r_[a, b], np.r_[b, a])), shape=shape)


def _agree(faces: Faces) -> Faces:
    graph, disagreement = _adjacency(faces)
    count, part = connected_components(graph, directed=False)
    flip = np.zeros(len(faces), dtype=np.bool_)
    for seed in np.unique(part, return_index=True)[1][:count]:
        order, before = breadth_first_order(graph, seed, directed=False)
        for face in order[1:]:
            flip[face] = flip[before[face]] ^ (disagreement[before[face], face] == 2.0)
    return np.where(flip[:, None], faces[:, ::-1], faces).astype(np.int32)
