"""Splits a mesh at its creases, so that a browser shades smooth parts smoothly and edges sharply."""

from typing import Final

import numpy as np

from manipnet.geometry import Array

SHARPEST_RAD: Final = np.radians(38.0)
"""Two triangles that meet at a larger angle have a crease between them."""


def split_at_creases(vertices: Array, faces: np.ndarray) -> tuple[Array, np.ndarray]:
    """The same surface with a vertex of its own for each smooth part around it: `(m, 3)` and `(f, 3)`.

    A browser averages the normals of all triangles at a vertex. Where two parts of a mesh meet at an angle, as a handle
    and a mug do, the average fits neither of them, and the long triangles there look like spikes.
    """
    faces = np.asarray(faces, dtype=np.int64)
    part = np.arange(faces.size)
    first, second = _smooth_corners(vertices, faces)
    while True:  # as often as there are triangles around the vertex, at most
        least = np.minimum(part[first], part[second])
        before = part.copy()
        np.minimum.at(part, first, least)
        np.minimum.at(part, second, least)
        if np.array_equal(part, before):
            break
    kept, corners = np.unique(part, return_inverse=True)
    return vertices[faces.ravel()[kept]], corners.reshape(-1, 3).astype(np.int32)


def _smooth_corners(vertices: Array, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of corners of triangles, as indices into `faces.ravel()`, that share a vertex and a smooth edge."""
    p, q, r = (vertices[faces[:, k]] for k in range(3))
    normals = np.cross(q - p, r - p)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(lengths > 0.0, lengths, 1.0)
    corner = np.arange(faces.size).reshape(-1, 3)
    begin, end = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
    flat = faces.ravel()
    low, high = np.minimum(flat[begin], flat[end]), np.maximum(flat[begin], flat[end])
    order = np.lexsort((high, low))
    same = (low[order][1:] == low[order][:-1]) & (high[order][1:] == high[order][:-1])
    a, b = order[:-1][same], order[1:][same]
    flat_enough = (normals[a // 3] * normals[b // 3]).sum(axis=1) > np.cos(SHARPEST_RAD)
    sliver = (lengths[a // 3, 0] == 0.0) | (lengths[b // 3, 0] == 0.0)
    a, b = a[flat_enough | sliver], b[flat_enough | sliver]
    ends = np.where(flat[begin[a]] == flat[begin[b]], [begin[b], end[b]], [end[b], begin[b]])
    return np.concatenate([begin[a], end[a]]), np.concatenate([ends[0], ends[1]])
