"""Objects made by rule: closed, always the same, and filled by their convex pieces."""

import numpy as np
import pytest

pytest.importorskip("manifold3d", reason="needs the extra generate")
from trimesh.convex import convex_hull

from manipnet_tools.generate.shapes import KINDS, make_shape

SHAPES = range(40)


@pytest.fixture(scope="module")
def shapes():
    return [make_shape(number, seed=1) for number in SHAPES]


def test_every_kind_is_made(shapes):
    assert {shape.kind for shape in shapes} == set(KINDS)


def test_a_number_always_gives_the_same_shape(shapes):
    for number in (0, 7, 19):
        again = make_shape(number, seed=1)
        assert np.array_equal(again.mesh.vertices, shapes[number].mesh.vertices)
        assert np.array_equal(again.mesh.faces, shapes[number].mesh.faces)
        assert not np.array_equal(make_shape(number, seed=2).mesh.vertices[:9], shapes[number].mesh.vertices[:9])


def test_sizes_are_those_of_things_to_hold(shapes):
    for shape in shapes:
        extents = np.ptp(shape.mesh.vertices, axis=0)
        assert extents.max() < 0.4, shape.mesh.name
        assert np.sort(extents)[1] > 0.008, shape.mesh.name
        assert 150 < len(shape.mesh.faces) < 12_000, shape.mesh.name


def test_pieces_cover_the_surface_and_leave_hollows_open(shapes):
    for shape in shapes:
        hulls = [convex_hull(piece) for piece in shape.pieces]
        outside = np.min([_beyond(hull, shape.mesh.vertices) for hull in hulls], axis=0)
        assert np.percentile(outside, 98) < 0.004, shape.mesh.name
        filled = sum(hull.volume for hull in hulls)
        assert filled < 1.6 * _volume(shape.mesh), shape.mesh.name


def test_handles_rims_and_knobs_lie_in_the_object(shapes):
    for shape in shapes:
        hulls = [convex_hull(piece) for piece in shape.pieces]
        for site in shape.sites:
            if site.kind != "stick":  # a cup is held around its cavity
                assert min(_beyond(hull, site.point[None])[0] for hull in hulls) < 0.004, (shape.mesh.name, site)
            assert abs(site.along @ site.out) < 1e-6
            assert site.radius > 0.0


def _beyond(hull, points):
    """How far points are outside a convex body, at most."""
    return (hull.face_normals @ points.T - np.sum(hull.face_normals * hull.triangles[:, 0], axis=1)[:, None]).max(
        axis=0
    )


def _volume(mesh):
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return float(np.sum(a * np.cross(b, c)) / 6.0)
