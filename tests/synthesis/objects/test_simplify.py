"""Reduced meshes: closed, and within the tolerance."""

import numpy as np
import pytest
import trimesh

from manipnet.synthesis.objects.mesh import ClosedMesh, closed_mesh
from manipnet.synthesis.objects.shape import build_shape, cache_name
from manipnet.synthesis.objects.simplify import FEWER_TRIANGLES, MOST_TRIANGLES, WITHIN_M, simplified

RADIUS = 0.04


@pytest.fixture(scope="module")
def ball() -> ClosedMesh:
    body = trimesh.creation.icosphere(subdivisions=6, radius=RADIUS)
    return closed_mesh(body.vertices, body.faces, "ball")


def _rough(mesh: ClosedMesh, noise_m: float) -> ClosedMesh:
    noise = noise_m * np.random.default_rng(0).normal(size=mesh.vertices.shape)
    return closed_mesh(mesh.vertices + noise, mesh.faces, "rough")


@pytest.mark.slow
def test_a_large_mesh_is_sensed_with_fewer_triangles_within_the_tolerance(ball: ClosedMesh, tmp_path) -> None:
    assert len(ball.faces) > MOST_TRIANGLES
    shape = build_shape(ball, tmp_path)
    assert len(shape.bvh.corners) <= FEWER_TRIANGLES
    assert shape.mesh is ball
    points = np.random.default_rng(1).normal(size=(2000, 3))
    points *= np.random.default_rng(2).uniform(0.5, 2.5, (2000, 1)) * RADIUS / np.linalg.norm(points, axis=1)[:, None]
    distance, _, _ = shape.signed_distance(points)
    np.testing.assert_allclose(distance, np.linalg.norm(points, axis=1) - RADIUS, atol=WITHIN_M + 1e-5)
    again = build_shape(ball, tmp_path)
    np.testing.assert_array_equal(again.bvh.corners, shape.bvh.corners)


@pytest.mark.slow
def test_a_rough_mesh_is_sensed_as_it_is(ball: ClosedMesh) -> None:
    rough = _rough(ball, WITHIN_M)
    assert simplified(rough) is rough


def test_a_small_mesh_is_sensed_as_it_is_and_found_in_older_caches() -> None:
    body = trimesh.creation.icosphere(subdivisions=4, radius=RADIUS)
    small = closed_mesh(body.vertices, body.faces, "small")
    assert simplified(small) is small
    assert cache_name(small).count("-") == 2
