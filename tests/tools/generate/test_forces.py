"""Contacts that carry an object, and forces that press without moving it."""

import numpy as np
import pytest

from manipnet_tools.generate.forces import FRICTION, carried, cone_columns, squeeze

pytestmark = pytest.mark.quick
TRIPOD = 0.02 * np.array([[1.0, 0, 0], [-0.5, 0, 0.87], [-0.5, 0, -0.87]])
NORMALS = TRIPOD / np.linalg.norm(TRIPOD, axis=1, keepdims=True)


def test_three_opposed_contacts_carry_an_object_whichever_way_gravity_points():
    assert carried(cone_columns(TRIPOD, NORMALS, np.zeros(3))).all()


def test_contacts_from_one_side_do_not():
    points = np.array([[0.0, 0.01, 0.0], [0.02, 0.01, 0.0], [0.0, 0.01, 0.02]])
    normals = np.tile([0.0, 1.0, 0.0], (3, 1))
    found = carried(cone_columns(points, normals, np.zeros(3)))
    assert not found.all()
    assert found[1], "it is pushed downward, so it is carried where gravity points up"


def test_no_contact_carries_nothing():
    assert not carried(cone_columns(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(3))).any()


def test_squeezing_forces_cancel_each_other_inside_their_cones():
    forces = squeeze(TRIPOD, NORMALS, np.zeros(3), total_n=15.0)
    assert np.allclose(forces.sum(axis=0), 0.0, atol=0.2)
    assert np.allclose(np.cross(TRIPOD, forces).sum(axis=0), 0.0, atol=0.02)
    pushes = -np.sum(forces * NORMALS, axis=1)
    aside = np.linalg.norm(forces + pushes[:, None] * NORMALS, axis=1)
    assert (pushes > 0.3).all()
    assert (aside <= FRICTION * pushes + 1e-9).all()
    assert pushes.sum() == pytest.approx(15.0, rel=0.1)
