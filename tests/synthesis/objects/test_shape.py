"""Shapes: distances, rays, mass and cache, against analytic bodies, brute force and independent values."""

import io
import subprocess
import sys

import numpy as np
import pytest
import trimesh
from compiled import call
from trimesh.triangles import mass_properties

from manipnet.demo.player import DEMO_OBJECTS
from manipnet.synthesis.objects.bvh import least_along
from manipnet.synthesis.objects.distance_field import field_distance
from manipnet.synthesis.objects.library import LIBRARY_FOLDER, library_names, load_library_mesh
from manipnet.synthesis.objects.mass import mass_of
from manipnet.synthesis.objects.mesh import closed_mesh
from manipnet.synthesis.objects.ply import ply_file
from manipnet.synthesis.objects.rays import TreeRays
from manipnet.synthesis.objects.shape import PREBUILT_FOLDER, build_shape, cache_name, cached_mesh, load_shape

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


@pytest.mark.parametrize("name", library_names())
def test_mass_properties_are_those_that_trimesh_finds(name):
    mesh = load_library_mesh(name)
    place = np.array([3.0, -2.0, 5.0])
    mass = mass_of(mesh.vertices + place, mesh.faces)
    expected = mass_properties(mesh.vertices[mesh.faces])
    np.testing.assert_allclose(mass.center_of_mass - place, expected["center_mass"], atol=1e-12)
    np.testing.assert_allclose(mass.volume_m3, expected["volume"], rtol=1e-9)
    inertia = expected["inertia"] / expected["mass"]
    np.testing.assert_allclose(mass.inertia, inertia, atol=1e-9 * np.abs(inertia).max())


def test_a_file_that_was_read_before_needs_no_reader(tmp_path):
    path = tmp_path / "crate.ply"
    trimesh.creation.box((0.1, 0.2, 0.3)).export(path)
    program = f"""
import os, sys
from manipnet.synthesis.objects.shape import load_shape  # the cache of compiled code stays the usual one
os.environ["MANIPNET_CACHE"] = {str(tmp_path / "cache")!r}
print(load_shape({str(path)!r}, "m", 2.0).volume_m3, load_shape("mug").volume_m3, "trimesh" in sys.modules)
"""
    answers = [subprocess.run([sys.executable, "-c", program], text=True, capture_output=True) for _ in range(2)]
    assert not any(answer.stderr for answer in answers), answers
    (volume, mug, read), (again, mug_again, read_again) = (answer.stdout.split() for answer in answers)
    assert float(volume) == pytest.approx(0.048)
    assert (again, mug_again) == (volume, mug)
    assert (read, read_again) == ("True", "False")


def test_a_cached_mesh_belongs_to_the_content_the_unit_and_the_scale(tmp_path, monkeypatch):
    monkeypatch.setenv("MANIPNET_CACHE", str(tmp_path / "cache"))
    path = tmp_path / "crate.ply"
    trimesh.creation.box((0.1, 0.1, 0.1)).export(path)
    assert load_shape(path).volume_m3 == pytest.approx(1e-3)
    assert load_shape(path, scale=2.0).volume_m3 == pytest.approx(8e-3)
    assert load_shape(path, "cm", 50.0).volume_m3 == pytest.approx(1.25e-4)
    assert load_shape(path, name="box").name == "box"
    trimesh.creation.box((0.2, 0.1, 0.1)).export(path)
    assert load_shape(path).volume_m3 == pytest.approx(2e-3)
    assert cached_mesh(path) is not None
    for file in (tmp_path / "cache").glob("mesh-*"):
        file.write_bytes(b"not an archive")
    assert load_shape(path).volume_m3 == pytest.approx(2e-3)
    assert cached_mesh(tmp_path / "none.ply") is None


@pytest.mark.parametrize("name", library_names())
def test_meshes_of_the_library_are_closed_in_advance(name, tmp_path, monkeypatch):
    monkeypatch.setenv("MANIPNET_CACHE", str(tmp_path))
    path = LIBRARY_FOLDER / f"{name}.ply"
    mesh = cached_mesh(path)
    assert mesh is not None, "run python -m manipnet_tools.assets.prebuilt_shapes"
    assert mesh.content_hash == load_library_mesh(name).content_hash


def test_a_ply_file_reads_as_it_was_written():
    mesh = load_library_mesh("mug")
    read = trimesh.load_mesh(io.BytesIO(ply_file(mesh.vertices, mesh.faces)), file_type="ply", process=False)
    np.testing.assert_array_equal(read.vertices, mesh.vertices)
    np.testing.assert_array_equal(read.faces, mesh.faces)


def test_the_shapes_of_the_demo_are_prebuilt(tmp_path):
    for name in DEMO_OBJECTS:
        mesh = load_library_mesh(name)
        assert (PREBUILT_FOLDER / cache_name(mesh)).is_file(), "run python -m manipnet_tools.assets.prebuilt_shapes"
        shipped = build_shape(mesh, tmp_path)
        np.testing.assert_allclose(np.abs(shipped.signed_distance(mesh.vertices[::50])[0]), 0.0, atol=1e-6)
        assert not list(tmp_path.iterdir()), "a shipped shape needs no building"
