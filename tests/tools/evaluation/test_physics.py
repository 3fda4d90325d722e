"""Appendix A on motions and grasps whose answer is known."""

import numpy as np
import pytest

from manipnet import geometry
from manipnet_tools.evaluation import metrics, physics

RADIUS = 0.04
SPHERE = physics.Body(np.zeros(3), 0.4 * RADIUS**2 * np.eye(3), RADIUS * np.concatenate([np.eye(3), -np.eye(3)]))
BRICK = physics.Body(np.array([0.01, 0.02, 0.0]), np.diag([1e-3, 2e-3, 4e-3]), np.zeros((1, 3)))
TIME = np.arange(120) / 60.0
WEIGHT = np.array([0.0, physics.GRAVITY_M_S2, 0.0])


def poses(p: np.ndarray, q: np.ndarray | None = None) -> np.ndarray:
    return np.concatenate([p, np.tile([0.0, 0, 0, 1], (len(p), 1)) if q is None else q], axis=1)


def touching(*directions: tuple[float, float, float]) -> metrics.Gaps:
    """Contacts on the sphere in the given directions, one frame."""
    normal = np.array(directions) / np.linalg.norm(directions, axis=1, keepdims=True)
    return metrics.Gaps(np.zeros((1, len(normal))), RADIUS * normal[None], normal[None])


def test_a_parabola_has_its_acceleration():
    acceleration = np.array([1.0, -2.0, 3.0])
    T = poses(0.5 * acceleration * TIME[:, None] ** 2)
    wrench = physics.wrench_needed(T, BRICK)
    np.testing.assert_allclose(wrench[:, :3], np.tile(acceleration + WEIGHT, (120, 1)), atol=1e-9)
    np.testing.assert_allclose(wrench[:, 3:], 0.0, atol=1e-9)


def test_forces_are_in_the_object_axes():
    quarter = geometry.quat_exp(np.array([0.0, 0.0, np.pi / 2]))  # the object's x points up
    wrench = physics.wrench_needed(poses(np.zeros((30, 3)), np.tile(quarter, (30, 1))), BRICK)
    np.testing.assert_allclose(wrench[:, :3], np.tile([physics.GRAVITY_M_S2, 0, 0], (30, 1)), atol=1e-9)


def test_free_fall_needs_no_contact():
    T = poses(-0.5 * WEIGHT * TIME[:, None] ** 2)
    wrench = physics.wrench_needed(T, SPHERE)
    nothing = metrics.Gaps(np.ones((120, 1)), np.zeros((120, 1, 3)), np.zeros((120, 1, 3)))
    residual = physics.residuals([nothing, nothing], wrench, SPHERE)
    assert physics.explained_share(residual, np.ones(120, dtype=bool)) == 1.0
    standing = physics.residuals([nothing], physics.wrench_needed(poses(np.zeros((120, 3))), SPHERE), SPHERE)
    np.testing.assert_allclose(standing, physics.GRAVITY_M_S2)


@pytest.mark.parametrize("flip", [False, True])
def test_a_steady_spin_off_a_principal_axis_needs_a_torque(flip):
    spin = np.array([0.8, 0.6, 0.4])
    q = geometry.quat_exp(spin * TIME[:, None])
    if flip:
        q[::7] *= -1.0  # the same rotations
    offset = geometry.quat_rotate(q, BRICK.center_of_mass)
    wrench = physics.wrench_needed(poses(-offset, q), BRICK)  # the centre of mass stays put
    expected = np.cross(spin, BRICK.inertia @ spin) / physics.RULE.lever_m
    np.testing.assert_allclose(wrench[10:-10, 3:], np.tile(expected, (100, 1)), atol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(wrench[:, :3], axis=1), physics.GRAVITY_M_S2, atol=1e-6)


@pytest.mark.parametrize(
    ("directions", "held"),
    [
        (((1, 0, 0), (-1, 0, 0)), True),  # squeezed between two antipodal points
        (((1, 0, 0),), False),  # pushed from one side
        (((0, -1, 0),), True),  # resting on a palm
        (((1, 0.1, 0), (-1, 0.1, 0)), True),  # a little above the middle: within the cone
        (((1, 0.6, 0), (-1, 0.6, 0)), False),  # well above it: slips out, tan > 0.35
        (((0, 1, 0), (1, 1, 0), (-1, 1, 0)), False),  # only from above
    ],
)
def test_a_sphere_held_by_points(directions, held):
    wrench = physics.wrench_needed(poses(np.zeros((30, 3))), SPHERE)[:1]
    residual = physics.residuals([touching(*directions)], wrench, SPHERE)
    assert bool(physics.explained_share(residual, np.array([True]))) is held
    if held:
        assert residual[0] == pytest.approx(0.0, abs=1e-9)


def test_two_hands_hold_what_one_cannot():
    wrench = physics.wrench_needed(poses(np.zeros((30, 3))), SPHERE)[:1]
    left, right = touching((1, 0, 0)), touching((-1, 0, 0))
    assert physics.residuals([left, right], wrench, SPHERE)[0] == pytest.approx(0.0, abs=1e-9)
    away = metrics.Gaps(np.full((1, 1), 0.0041), right.point, right.normal)
    assert physics.residuals([left, away], wrench, SPHERE)[0] > physics.RULE.tolerance_m_s2


def test_the_rule_of_the_paper_requires_overlap():
    wrench = physics.wrench_needed(poses(np.zeros((30, 3))), SPHERE, physics.PAPER)[:1]
    grip = touching((1, 0, 0), (-1, 0, 0))
    apart = metrics.Gaps(grip.gap + 0.001, grip.point, grip.normal)
    inside = metrics.Gaps(grip.gap - 0.001, grip.point, grip.normal)
    share = [
        physics.explained_share(
            physics.residuals([hand], wrench, SPHERE, physics.PAPER), np.array([True]), physics.PAPER
        )
        for hand in (apart, inside)
    ]
    assert share == [0.0, 1.0]


def test_lifted_depends_on_the_lowest_point():
    p = np.zeros((3, 3))
    p[:, 1] = [RADIUS, RADIUS + 0.019, RADIUS + 0.021]
    assert physics.lifted(poses(p), SPHERE).tolist() == [False, False, True]
