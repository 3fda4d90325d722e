"""The library of objects: closed meshes of the right size, equal to what their generator makes."""

import numpy as np
import pytest
import trimesh

from manipnet.synthesis.objects.library import LIBRARY_FOLDER, library_names, load_library_mesh
from manipnet.synthesis.objects.mesh import MeshError
from manipnet.synthesis.objects.shape import Shape, build_shape

CM3 = 1e-6
VOLUMES_CM3 = {
    "cube": 6.0**3,
    "cylinder": np.pi * 3.0**2 * 8.0,
    "sphere": 4.0 / 3.0 * np.pi * 3.5**3,
    "torus": 2.0 * np.pi**2 * 4.2 * 1.3**2,
    "prism": np.sqrt(3.0) / 4.0 * 7.0**2 * 10.0,
    "tetrahedron": 9.0**3 / (6.0 * np.sqrt(2.0)),
    "hemisphere": 2.0 / 3.0 * np.pi * 4.5**3,
}
FLAT_SIDED = {"cube", "prism", "tetrahedron"}
WITH_A_HOLE = {"torus", "mug"}


def surface(name: str) -> trimesh.Trimesh:
    mesh = load_library_mesh(name)
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


@pytest.mark.parametrize("name", library_names())
def test_shape_is_closed_and_fits_a_hand(name: str):
    mesh = surface(name)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0.0
    assert mesh.body_count == 1
    assert mesh.euler_number == (0 if name in WITH_A_HOLE else 2)
    assert len(mesh.faces) <= 6000
    assert 0.05 < mesh.extents.max() < 0.31
    assert np.linalg.norm(mesh.center_mass) < 0.08, "the origin is where a hand closes around it"


@pytest.mark.parametrize("name", VOLUMES_CM3)
def test_the_volume_agrees_with_the_formula(name: str):
    tolerance = 1e-5 if name in FLAT_SIDED else 0.012  # chords lie inside the curve
    assert surface(name).volume == pytest.approx(VOLUMES_CM3[name] * CM3, rel=tolerance)


@pytest.mark.parametrize("name", [*VOLUMES_CM3, "bowl", "wine_glass", "bottle", "hammer", "mug"])
def test_centre_of_mass_is_on_the_planes_of_symmetry(name: str):
    """Every shape is symmetric about z = 0 except the hammer, whose head points along z; it is about x = 0."""
    across = 0 if name == "hammer" else 2
    assert abs(surface(name).center_mass[across]) < 2e-4


@pytest.fixture(scope="module")
def mug() -> Shape:
    return build_shape(load_library_mesh("mug"))


def test_mug_is_hollow_and_has_a_handle_to_reach_through(mug: Shape):
    cavity, wall, bottom, gap, grip = mug.signed_distance(
        np.array([(0, 10, 0), (38.7, 0, 0), (0, -45, 0), (54, 0, 0), (73, 0, 0)]) * 1e-3
    )[0]
    assert cavity == pytest.approx(0.0365, abs=5e-4)
    assert wall < 0.0
    assert bottom < 0.0
    assert gap > 0.01, "a finger fits between body and handle"
    assert grip < 0.0
    through = mug.trace(np.array([[0.054, 0.0, -0.1]]), np.array([[0.0, 0.0, 1.0]]))
    assert np.isinf(through[0])


def test_the_scale_resizes_the_whole_object():
    assert np.allclose(load_library_mesh("cube", scale=2.0).vertices, 2.0 * load_library_mesh("cube").vertices)


def test_an_unknown_name_is_refused_with_the_list():
    with pytest.raises(MeshError, match="the library has no object 'spoon'; it has bottle, bowl"):
        load_library_mesh("spoon")


@pytest.mark.parametrize("name", library_names())
def test_generator_makes_the_stored_shape(name: str):
    """Compared by volume and size: the union of meshes may order its triangles otherwise in another version."""
    pytest.importorskip("manifold3d")
    from manipnet_tools.assets.objects import SHAPES

    made, stored = SHAPES[name](), surface(name)
    assert 1e-9 * made.volume == pytest.approx(stored.volume, rel=1e-5)
    assert np.allclose(1e-3 * made.bounds, stored.bounds, atol=1e-6)
    assert set(SHAPES) == {path.stem for path in LIBRARY_FOLDER.glob("*.ply")}
