"""Solvers: reachable targets are reached within limits, capsules leave the object, angles stay inside limits."""

import numpy as np
import pytest
import trimesh
from compiled import call
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from manipnet.geometry import compose, quat_exp
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.ik.ccd import solve_ccd
from manipnet.synthesis.ik.chains import Surface
from manipnet.synthesis.ik.grasp import finger_confidences_into, grasp_confidence, slip_and_rest
from manipnet.synthesis.ik.least_squares import solve_least_squares
from manipnet.synthesis.ik.targets import mix_distances, place_targets
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.objects.mesh import closed_mesh
from manipnet.synthesis.objects.shape import build_shape

HAND = shipped_hand()

LOW, HIGH = HAND.limits.T
FAR = np.array([5.0, 5.0, 5.0])
NOT_TOUCHING = np.full(22, 1.0)
fractions = arrays(np.float64, 20, elements=st.floats(0.15, 0.85))
nudges = arrays(np.float64, 20, elements=st.floats(-0.15, 0.15))


@pytest.fixture(scope="module")
def ball(tmp_path_factory):
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.03)
    return build_shape(closed_mesh(mesh.vertices, mesh.faces, "ball"), tmp_path_factory.mktemp("cache"))


def solve_beside(ball, predicted, targets, confidence, center, angles, clear_m=0.0):
    """Least squares with the ball at `center` of the wrist frame, from `angles` to better ones there."""
    surface = Surface(ball.field, np.eye(3), -center, 1.0)
    hand, grip = (HAND.skeleton, HAND.chains), (np.zeros(5), np.zeros(20))
    surely = NOT_TOUCHING, confidence, clear_m
    call(solve_least_squares, *hand, predicted, targets, *surely, HAND.limits, surface, *grip, angles)


def solve(name, ball, angles, targets, center=FAR):
    """Solve with the ball at `center` of the wrist frame."""
    solved = angles.copy()
    if name == "ccd":
        call(solve_ccd, HAND.skeleton, HAND.chains, angles, targets, HAND.limits, solved)
    else:
        solve_beside(ball, angles, targets, 0.0, center, solved)
    return solved


@pytest.mark.parametrize(("name", "within_m"), [("ccd", 2e-3), ("least_squares", 1.5e-3)])
@settings(deadline=None)
@given(fraction=fractions, nudge=nudges)
def test_reachable_targets_are_reached(ball, name, within_m, fraction, nudge):
    goal = np.clip(LOW + fraction * (HIGH - LOW), LOW, HIGH)
    targets, _ = forward_kinematics(HAND, goal)
    start = np.clip(goal + nudge, LOW, HIGH)
    solved = solve(name, ball, start, targets)
    before = np.linalg.norm(forward_kinematics(HAND, start)[0] - targets, axis=1)
    after = np.linalg.norm(forward_kinematics(HAND, solved)[0] - targets, axis=1)
    assert after.max() <= max(within_m, 0.35 * before.max())


@pytest.mark.parametrize("name", ["ccd", "least_squares"])
@settings(deadline=None)
@given(fraction=fractions, shift=arrays(np.float64, (22, 3), elements=st.floats(-0.1, 0.1)))
def test_limits_hold_whatever_the_targets(ball, name, fraction, shift):
    start = LOW + fraction * (HIGH - LOW)
    targets = forward_kinematics(HAND, start)[0] + shift
    solved = solve(name, ball, start, targets)
    assert np.all(np.isfinite(solved))
    assert np.all(solved >= LOW)
    assert np.all(solved <= HIGH)


def capsule_depth(positions, center):
    fraction = np.linspace(0.0, 1.0, 9)[:, None, None]
    start, end = positions[HAND.capsules[4:, 0]], positions[HAND.capsules[4:, 1]]
    gap = np.linalg.norm(start + fraction * (end - start) - center, axis=-1) - 0.03 - HAND.radii[4:]
    return np.maximum(-gap.min(axis=0), 0.0)


def test_fingers_leave_the_object(ball):
    start = np.tile([0.3, 0.2, 0.4, 0.3], 5)
    start[:4] = 0.0
    positions, _ = forward_kinematics(HAND, start)
    center = positions[9] + np.array([0.0, 0.0, -0.03])
    solved = solve("least_squares", ball, start, positions, center)
    deep, left = capsule_depth(positions, center), capsule_depth(forward_kinematics(HAND, solved)[0], center)
    assert deep.max() > 0.008
    assert left.max() < 0.5 * deep.max()
    assert left.mean() < 0.4 * deep.mean()


def test_targets_follow_appendix_b(ball):
    center = np.array([0.2, 0.0, 0.0])
    positions = np.zeros((22, 3))
    positions[:, 0] = 0.2 - 0.03 - np.linspace(-0.01, 0.05, 22)
    distances = np.full(22, 0.008)
    distances[-1] = 0.03
    targets = np.empty((22, 3))
    exact = ball.solid._replace(exact_within_m=np.inf)
    call(place_targets, exact, np.eye(3), -center, 1.0, positions, distances, targets)
    measured = ball.signed_distance(positions - center)[0]
    wanted = [call(mix_distances, 0.008, d) for d in measured[:-1]]
    np.testing.assert_allclose(ball.signed_distance(targets[:-1] - center)[0], wanted, atol=1e-4)
    np.testing.assert_array_equal(targets[-1], positions[-1])


def test_mixing_trusts_the_prediction_inside_and_the_position_outside():
    assert call(mix_distances, 0.01, -0.01) == pytest.approx(0.8 * 0.01 - 0.2 * 0.01)
    assert call(mix_distances, 0.01, 0.02) == pytest.approx(0.2 * 0.01 + 0.8 * 0.02)


def carried(speed_m_s, turn_rad_s):
    """A window of a wrist that moves and turns."""
    t = np.linspace(-0.5, 0.5, 21)
    return np.stack(
        [np.concatenate([[speed_m_s * s, 1.0, 0.0], quat_exp(np.array([0.0, turn_rad_s * s, 0.0]))]) for s in t]
    )


BESIDE = np.array([0.1, 0.0, -0.05, 0.0, 0.6, 0.0, 0.8])
CLOSE = np.tile(np.array([0.05, 1.0, 0.05]), (21, 1))
"""Another wrist near all these objects."""
STILL = np.tile(np.array([0.2, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]), (21, 1))


@pytest.mark.parametrize(("speed", "turn"), [(0.2, 0.0), (0.0, 1.0), (0.1, -0.7)])
def test_an_object_that_moves_with_the_wrist_is_held(speed, turn):
    wrist = carried(speed, turn)
    assert call(grasp_confidence, wrist, compose(wrist, np.tile(BESIDE, (21, 1))), CLOSE) == pytest.approx(1.0)


def test_an_object_that_rests_or_moves_by_itself_is_not_held():
    wrist = carried(0.3, 0.5)
    assert call(grasp_confidence, wrist, STILL, CLOSE) == 0.0
    assert call(grasp_confidence, STILL, wrist, CLOSE) == 0.0
    assert call(grasp_confidence, STILL, compose(STILL, np.tile(BESIDE, (21, 1))), CLOSE) == 0.0


@pytest.mark.parametrize(("speed", "turn"), [(0.3, 0.0), (0.02, 3.0)])
def test_a_hand_that_passes_an_object_at_rest_slips(speed, turn):
    wrist = carried(speed, turn)
    assert call(slip_and_rest, wrist, STILL) == (1.0, 1.0)
    assert call(slip_and_rest, wrist, compose(wrist, np.tile(BESIDE, (21, 1)))) == (0.0, 0.0)
    assert call(slip_and_rest, STILL, compose(wrist, np.tile(BESIDE, (21, 1)))) == (1.0, 0.0)
    assert call(slip_and_rest, STILL, STILL) == (0.0, 1.0)


def test_what_moves_in_one_hand_while_the_other_is_far_is_held():
    far = CLOSE + np.array([0.0, 0.3, 0.0])
    moving = carried(0.3, 0.5)
    assert call(grasp_confidence, STILL, moving, far) == pytest.approx(1.0)
    assert call(grasp_confidence, STILL, STILL, far) == 0.0


def test_the_thumb_and_the_nearest_fingers_take_part_in_a_grasp():
    distances, confidences = np.full(22, 0.05), np.empty(5)
    distances[5:8] = distances[18] = 0.012  # the index finger
    distances[8:11] = distances[19] = 0.016
    call(finger_confidences_into, HAND.chains, distances, 0.8, confidences)
    assert confidences[0] == confidences[1] == pytest.approx(0.8)
    assert 0.0 < confidences[2] < 0.8
    assert np.all(confidences[3:] == 0.0)


def test_a_hand_that_holds_closes_on_the_object(ball):
    """Fingers without a predicted contact come onto the surface when the hand holds the object."""
    start = np.tile([0.1, 0.0, 0.1, 0.1], 5)
    positions, _ = forward_kinematics(HAND, start)
    center = positions[19] + np.array([0.0, 0.0, -0.03 - 0.02])
    gaps = []
    for hold in (0.0, 1.0):
        angles = start.copy()
        for _ in range(20):
            targets, _ = forward_kinematics(HAND, angles)
            solve_beside(ball, angles.copy(), targets, hold, center, angles)
        gaps.append(fingertip_gaps(forward_kinematics(HAND, angles)[0], center).min())
    assert gaps[0] > 0.008
    assert -0.008 < gaps[1] < 0.002


def test_a_hand_that_is_to_keep_clear_does(ball):
    predicted = np.zeros(20)
    targets, _ = forward_kinematics(HAND, predicted)
    center = targets[19] + np.array([0.0, 0.0, -0.038])
    touching, clear = predicted.copy(), predicted.copy()
    solve_beside(ball, predicted, targets, 0.0, center, touching)
    solve_beside(ball, predicted, targets, 0.0, center, clear, clear_m=0.010)
    near, far = (fingertip_gaps(forward_kinematics(HAND, angles)[0], center).min() for angles in (touching, clear))
    assert near < 0.002
    assert 0.005 < far < 0.010
    np.testing.assert_allclose(clear[:4], touching[:4], atol=1e-3, err_msg="the thumb is far away and stays")


def test_a_finger_deep_in_the_object_comes_out_on_the_side_it_entered(ball):
    """Beyond the middle of the ball the nearest surface is the far side, but a finger cannot pass through the ball."""
    predicted = np.zeros(20)
    predicted[9:12] = 0.5
    targets, _ = forward_kinematics(HAND, predicted)
    center = targets[19] + np.array([0.004, 0.0, 0.006])
    assert fingertip_gaps(targets, center).min() < -0.03
    solved = solve("least_squares", ball, predicted, targets, center)
    positions, _ = forward_kinematics(HAND, solved)
    assert fingertip_gaps(positions, center).min() > -0.01
    assert np.all(solved[9:12] < 0.45)
    np.testing.assert_allclose(solved[4:8], predicted[4:8], atol=0.05, err_msg="its neighbour stays")


def fingertip_gaps(positions, center):
    along = np.linspace(0.0, 1.0, 9)[:, None, None]
    start, end = positions[HAND.capsules[6:, 0]], positions[HAND.capsules[6:, 1]]
    return np.linalg.norm(start + along * (end - start) - center, axis=-1) - 0.03 - HAND.radii[6:]
