"""Metrics against cases counted by hand."""

import numpy as np
import pytest

from manipnet.synthesis.model.shipped import shipped_hand
from manipnet_tools.evaluation import metrics

HAND = shipped_hand()
IDENTITY = np.array([0.0, 0, 0, 0, 0, 0, 1])
PINKY_CAPSULES = (17, 18)


class Floor:
    """The half-space y < 0."""

    def signed_distance(self, points):
        flat = points * [1.0, 0.0, 1.0]
        return points[:, 1], np.broadcast_to([0.0, 1.0, 0.0], points.shape), flat


def hand_with_pinky_at(height: float, frames: int = 1) -> np.ndarray:
    """A hand a metre above the floor but for the last two pinky joints."""
    positions = np.zeros((frames, 22, 3))
    positions[..., 1] = 1.0
    positions[:, [16, 21], 1] = height
    return positions


def gaps_of(positions: np.ndarray) -> metrics.Gaps:
    return metrics.capsule_gaps(HAND, positions, np.broadcast_to(IDENTITY, (len(positions), 7)), Floor())


def bare_gaps(gap: list[list[float]]) -> metrics.Gaps:
    values = np.array(gap)
    return metrics.Gaps(values, np.zeros((*values.shape, 3)), np.zeros((*values.shape, 3)))


def test_a_capsule_four_millimetres_deep():
    tip, middle = HAND.radii[18], HAND.radii[17]
    gaps = gaps_of(hand_with_pinky_at(tip - 0.004))
    assert gaps.gap[0, 18] == pytest.approx(-0.004)
    assert gaps.gap[0, 17] == pytest.approx(-0.004 - (middle - tip))
    np.testing.assert_allclose(gaps.normal[0, 18], [0, 1, 0])
    assert metrics.penetration_cm(gaps) == pytest.approx((0.4 + 0.4 + 100 * (middle - tip)) / 19)
    assert metrics.deep_frames(gaps) == 0.0
    assert metrics.deeper_share(gaps, 0.0039) == pytest.approx(2 / 19)


def test_deep_frames_and_shares_are_counted():
    depth = HAND.radii[18] - np.array([0.0, 0.011, 0.016, 0.02])
    gaps = gaps_of(np.concatenate([hand_with_pinky_at(height) for height in depth]))
    assert metrics.deep_frames(gaps) == 0.5
    assert metrics.deeper_share(gaps) == pytest.approx(6 / (4 * 19))


def test_gaps_are_measured_in_the_object_frame():
    quarter_turn = np.array([0.0, 0, 0, np.sqrt(0.5), 0, 0, np.sqrt(0.5)])  # the object's y is the world's z
    raised = quarter_turn + np.array([0, 0, 0.25, 0, 0, 0, 0])
    positions = np.zeros((1, 22, 3))
    positions[..., 2] = 1.0
    gaps = metrics.capsule_gaps(HAND, positions, raised[None], Floor())
    np.testing.assert_allclose(gaps.gap[0], 0.75 - HAND.radii, atol=1e-12)


def test_palm_capsules_start_beyond_the_wrist():
    positions = np.zeros((22, 3))
    positions[[5, 6, 7, 18], 0] = 1.0
    axes = metrics.capsule_axes(HAND, positions)
    np.testing.assert_allclose(axes[0, :, 0], np.linspace(0.3, 1.0, 7))
    np.testing.assert_allclose(axes[7, :, 0], 1.0)


def test_contact_f1_counted_by_hand():
    captured = bare_gaps([[0.0, 0.004, 0.006], [0.1, -0.01, 0.1]])  # touches: 2 + 1
    ours = bare_gaps([[0.0, 0.006, 0.004], [0.1, -0.02, 0.1]])  # touches: 2 + 1, two of them right
    assert metrics.contact_f1(ours, captured) == pytest.approx(2 / 3)
    assert metrics.contact_f1(captured, captured) == 1.0
    assert np.isnan(metrics.contact_f1(bare_gaps([[1.0]]), bare_gaps([[1.0]])))


def test_near_and_idle_depend_on_the_closest_capsule():
    gaps = bare_gaps([[0.5, 0.02], [0.5, 0.1], [0.5, 0.2]])
    assert metrics.near(gaps).tolist() == [True, False, False]
    assert metrics.idle(gaps).tolist() == [False, False, True]


def test_smoothness_of_a_sinusoid():
    omega, amplitude, frames = 2 * np.pi * 2.0, 0.01, 60 * 30 + 2
    positions = np.zeros((frames, 22, 3))
    positions[:, 7, 0] = amplitude * np.sin(omega * np.arange(frames) / 60)
    peak = amplitude * (2 * np.sin(omega / 120)) ** 2 * 3600
    assert metrics.smoothness_cm_s2(positions) == pytest.approx(100 * peak * (2 / np.pi) / 22, rel=5e-3)


def test_smoothness_under_a_mask_leaves_the_edges_out():
    positions = np.zeros((9, 22, 3))
    positions[4:] = 1.0
    calm = np.array([1, 1, 1, 1, 0, 0, 1, 1, 1], dtype=bool)
    assert metrics.smoothness_cm_s2(positions) > 0
    assert metrics.smoothness_cm_s2(positions, calm) == 0.0
    assert np.isnan(metrics.smoothness_cm_s2(positions, np.zeros(9, dtype=bool)))


def test_joint_errors_leave_the_wrist_out():
    captured, ours = np.zeros((2, 22, 3)), np.zeros((2, 22, 3))
    ours[1, 1:, 2] = 0.02
    ours[1, 17:, 2] = 0.05
    np.testing.assert_allclose(metrics.joint_error_m(ours, captured), [0, (16 * 0.02 + 5 * 0.05) / 21])
    np.testing.assert_allclose(metrics.fingertip_error_m(HAND, ours, captured), [0, 0.05])


def test_longest_drift():
    error = np.concatenate([np.full(30, 0.01), np.full(12, 0.04), [0.0], np.full(18, 0.04)])
    assert metrics.longest_drift_s(error) == pytest.approx(0.3)
    assert metrics.longest_drift_s(np.zeros(5)) == 0.0


def test_only_fingertips_that_touch_in_two_successive_frames_slide():
    tip = HAND.radii[18]
    positions = hand_with_pinky_at(tip, frames=4)
    positions[:, 21, 0] = [0.0, 0.001, 0.003, 0.003]
    positions[:, 17, 0] = [0.0, 1.0, 2.0, 3.0]  # a thumb that moves, far from the floor
    assert metrics.slide_mm_s(HAND, positions, gaps_of(positions)) == pytest.approx(60.0 * (1 + 2 + 0) / 3)
    positions[1, [16, 21], 1] += 0.01
    assert metrics.slide_mm_s(HAND, positions, gaps_of(positions)) == pytest.approx(0.0)
    assert np.isnan(metrics.slide_mm_s(HAND, positions[:1], gaps_of(positions[:1])))
