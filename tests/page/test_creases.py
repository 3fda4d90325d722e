"""Meshes as the page draws them: split where parts meet at an angle, and otherwise as they were."""

import numpy as np
import pytest

from manipnet.page.creases import split_at_creases
from manipnet.synthesis.objects.library import load_library_mesh


def shown(name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    mesh = load_library_mesh(name)
    return mesh.vertices, mesh.faces, *split_at_creases(mesh.vertices, mesh.faces)


@pytest.mark.parametrize("name", ["cube", "mug", "hammer", "sphere"])
def test_every_triangle_stays_where_it_is(name: str) -> None:
    vertices, faces, split_vertices, split_faces = shown(name)
    np.testing.assert_array_equal(split_vertices[split_faces], vertices[faces])


def test_a_sphere_has_no_creases_and_a_cube_has_its_edges() -> None:
    vertices, _, split, _ = shown("sphere")
    assert len(split) == len(vertices)
    vertices, _, split, _ = shown("cube")
    assert len(split) == len(vertices) + 12 * 7 + 8 * 2, "each edge has 7 vertices inside, and 3 faces meet at a corner"


def test_no_normal_of_the_mug_stands_out_from_its_triangles() -> None:
    """A normal that fits none of the triangles at its vertex is drawn as a spike."""
    vertices, faces, split_vertices, split_faces = shown("mug")
    assert worst_angle(vertices, faces) > np.radians(60.0)
    assert worst_angle(split_vertices, split_faces) < np.radians(45.0)


def worst_angle(vertices: np.ndarray, faces: np.ndarray) -> float:
    """The largest angle between a triangle and the normal that a browser computes at one of its corners."""
    p, q, r = (vertices[faces[:, k]] for k in range(3))
    areas = np.cross(q - p, r - p)
    sums = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(sums, faces[:, k], areas)
    size = np.linalg.norm(areas, axis=1)
    large = size > 1e-3 * size.max()
    normals = sums / np.linalg.norm(sums, axis=1, keepdims=True)
    cosines = (normals[faces[large]] * (areas[large] / size[large, None])[:, None]).sum(axis=2)
    return float(np.arccos(np.clip(cosines.min(), -1.0, 1.0)))
