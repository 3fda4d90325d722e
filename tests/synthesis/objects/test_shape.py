"""Shapes: distances, rays, mass and cache, against analytic bodies, brute force and independent values."""

import numpy as np
import pytest
import trimesh
from compiled import call

from manipnet.demo.player import DEMO_OBJECTS
from manipnet.synthesis.objects.bvh import least_along
from manipnet.synthesis.objects.distance_field import field_distance
from manipnet.synthesis.objects.library import load_library_mesh
from manipnet.synthesis.objects.mesh import closed_mesh
from manipnet.synthesis.objects.rays import TreeRays
from manipnet.synthesis.objects.shape import PREBUILT_FOLDER, build_shape, cache_name, load_shape

RADIUS = 0.04
HALF = np.array([0.03, 0.04, 0.05])


@pytest.fixture(scope="module")
def sphere(tmp_path_factory):
    ball = trimesh.creation.icosphere(subdivisions=4, radius=RADIUS)
    return build_shape(closed_mesh(ball.vertices, ball.faces, "sphere"), tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    body = trimesh.creation.box(2 * HALF)
    return build_shape(closed_mesh(body.vertices, body.faces, "box"), tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="module")
def points():
    return np.random.default_rng(0).uniform(-0.12, 0.12, (500, 3))


def box_distance(p):
    q = np.abs(p) - HALF
    return np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0)


def test_distance_to_a_box_is_exact(box, points):
    distance, normal, closest = box.signed_distance(points)
    np.testing.assert_allclose(distance, box_distance(points), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-9)
    np.testing.assert_allclose(box_distance(closest), 0.0, atol=1e-9)


def test_distance_to_a_sphere(sphere, points):
    distance, normal, _ = sphere.signed_distance(points)
    radii = np.linalg.norm(points, axis=1)
    # an icosphere of this size is inside its sphere by at most 0.06 mm
    np.testing.assert_allclose(distance, radii - RADIUS, atol=1e-4)
    np.testing.assert_allclose(np.sum(normal * points, axis=1) / radii, 1.0, atol=2e-3)


def test_field_alone_is_close_away_from_edges(sphere, points):
    looked_up = np.array([call(field_distance, sphere.field, *p)[0] for p in points])
    exact, _, _ = sphere.signed_distance(points)
    far = np.abs(exact) > sphere.solid.exact_within_m
    away_from_center = np.linalg.norm(points, axis=1) > 0.02
    assert np.abs(looked_up - exact)[far & away_from_center].max() < 2e-4


def test_points_on_the_surface_have_a_normal(box):
    corners = np.vstack([box.mesh.vertices, [[HALF[0], 0.0, 0.0]]])
    distance, normal, _ = box.signed_distance(corners)
    np.testing.assert_allclose(distance, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-9)
    assert np.all(np.sum(normal * corners, axis=1) > 0.0)


@pytest.mark.parametrize("name", ["box", "sphere"])
def test_the_least_point_along_a_direction_is_that_of_the_vertices(name, request, points):
    body = request.getfixturevalue(name)
    for direction in np.vstack([points[:50], np.eye(3), -np.eye(3)]):
        expected = (body.mesh.vertices @ direction).min()
        assert call(least_along, body.bvh, direction) == pytest.approx(expected, abs=1e-12)


def test_rays_hit_a_sphere_at_the_computed_distance(sphere, points):
    outside = points[np.linalg.norm(points, axis=1) > RADIUS * 1.1]
    aim = -outside / np.linalg.norm(outside, axis=1, keepdims=True)
    np.testing.assert_allclose(sphere.trace(outside, aim), np.linalg.norm(outside, axis=1) - RADIUS, atol=1e-4)
    assert np.all(np.isinf(sphere.trace(outside, -aim)))


def test_rays_report_that_they_start_inside(box):
    origins = np.zeros((3, 3))
    distance, inside = box.rays.trace(origins, np.eye(3))
    np.testing.assert_allclose(distance, HALF, atol=1e-6)
    assert np.all(inside)


def test_our_rays_agree_with_the_fast_ones(sphere, points):
    rng = np.random.default_rng(1)
    directions = rng.normal(size=points.shape)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    fast, slow = sphere.rays.trace(points, directions), TreeRays(sphere.bvh).trace(points, directions)
    np.testing.assert_allclose(slow[0], fast[0], atol=1e-6)
    np.testing.assert_array_equal(slow[1], fast[1])


def test_mass_of_a_box(box):
    np.testing.assert_allclose(box.volume_m3, 8 * HALF.prod())
    np.testing.assert_allclose(box.center_of_mass, 0.0, atol=1e-12)
    squares = (2 * HALF) ** 2
    np.testing.assert_allclose(np.diag(box.inertia), (squares.sum() - squares) / 12.0)


def test_cache_gives_the_same_shape_and_survives_damage(tmp_path, points):
    body = trimesh.creation.box(2 * HALF)
    mesh = closed_mesh(body.vertices, body.faces, "box")
    built = build_shape(mesh, tmp_path).signed_distance(points)[0]
    (file,) = tmp_path.iterdir()
    np.testing.assert_array_equal(build_shape(mesh, tmp_path).signed_distance(points)[0], built)
    file.write_bytes(file.read_bytes()[:1000])
    np.testing.assert_array_equal(build_shape(mesh, tmp_path).signed_distance(points)[0], built)


@pytest.mark.parametrize("take", ["cube_med2", "cyl_med3", "mug1", "teapot2", "wineglass3"])
def test_independent_values(manipnet_data, take):
    checks = np.load(manipnet_data.parent / "checks" / "geometry.npz")
    shape = load_shape(
        manipnet_data / "meshes" / f"{take.rstrip('0123456789') + ('' if 'med' in take else take[-1])}.obj"
    )
    points = checks[f"{take}/points_object"].reshape(-1, 3)
    distance, _, closest = shape.signed_distance(points)
    expected = checks[f"{take}/closest_object"].reshape(-1, 3)
    np.testing.assert_allclose(np.abs(distance), np.linalg.norm(points - expected, axis=1), atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(closest - expected, axis=1), 0.0, atol=1e-5)
    # the values' signed distances carry an approximate winding number: only their sign is exact
    np.testing.assert_array_equal(distance < 0.0, checks[f"{take}/signed_distance"].reshape(-1) < 0.0)
    rays = [checks[f"{take}/ray_{name}_object"].reshape(-1, 3) for name in ("origin", "direction")]
    np.testing.assert_allclose(shape.trace(*rays), checks[f"{take}/ray_distance"].reshape(-1), atol=1e-5)
    np.testing.assert_allclose(shape.center_of_mass, checks[f"{take}/center_of_mass"], atol=1e-6)
    np.testing.assert_allclose(shape.volume_m3, checks[f"{take}/volume"], rtol=1e-6)


def test_the_shapes_of_the_demo_are_prebuilt(tmp_path):
    for name in DEMO_OBJECTS:
        mesh = load_library_mesh(name)
        assert (PREBUILT_FOLDER / cache_name(mesh)).is_file(), "run python -m manipnet_tools.assets.prebuilt_shapes"
        shipped = build_shape(mesh, tmp_path)
        np.testing.assert_allclose(np.abs(shipped.signed_distance(mesh.vertices[::50])[0]), 0.0, atol=1e-6)
        assert not list(tmp_path.iterdir()), "a shipped shape needs no building"
