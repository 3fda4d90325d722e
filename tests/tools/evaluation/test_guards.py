"""The two-sided guards against cases counted by hand."""

import numpy as np
import pytest

from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet_tools.evaluation import guards
from manipnet_tools.evaluation.metrics import Gaps

HAND = shipped_hand()
FLAT = forward_kinematics(HAND, np.zeros(HAND.angle_count))[0]
THUMB_TIP, TIPS = HAND.fingers[0][-1], [finger[-1] for finger in HAND.fingers[1:]]


def bare_gaps(gap) -> Gaps:
    values = np.array(gap, dtype=float)
    return Gaps(values, np.zeros((*values.shape, 3)), np.zeros((*values.shape, 3)))


def test_touching_capsules_are_counted_in_held_frames_only():
    gaps = bare_gaps([[0.0, 0.003, 0.005], [-0.02, 0.1, 0.1], [0.0, 0.0, 0.0]])
    assert guards.touching_capsules(gaps, np.array([True, True, False])) == 1.5
    assert np.isnan(guards.touching_capsules(gaps, np.zeros(3, dtype=bool)))


def test_the_aperture_is_the_distance_of_the_thumb_from_the_other_tips():
    positions = np.zeros((1, HAND.joint_count, 3))
    positions[0, TIPS, 1] = [0.02, 0.04, 0.06, 0.08]
    positions[0, THUMB_TIP, 2] = 0.0
    np.testing.assert_allclose(guards.aperture_m(HAND, positions), [0.05])


def test_the_hand_opens_before_contact():
    positions, gap = np.zeros((120, HAND.joint_count, 3)), np.full((120, 1), 0.1)
    positions[:, TIPS, 1] = 0.05
    positions[70, TIPS, 1] = 0.11  # the widest, 30 frames before the touch
    positions[20, TIPS, 1] = 0.2  # more than a second before
    gap[100:] = 0.0
    opening = guards.opening(HAND, positions, bare_gaps(gap))
    assert opening.peak_m == pytest.approx(0.11)
    assert opening.before_s == pytest.approx(0.5)


def test_a_contact_right_after_another_has_no_approach():
    gap = np.full((150, 1), 0.1)
    gap[[100, 130]] = 0.0
    positions = np.zeros((150, HAND.joint_count, 3))
    positions[120, TIPS, 1] = 1.0
    assert guards.opening(HAND, positions, bare_gaps(gap)).peak_m == 0.0
    assert np.isnan(guards.opening(HAND, positions, bare_gaps(np.full((150, 1), 0.1))).peak_m)


def test_energy_is_the_mean_squared_speed():
    positions = np.zeros((5, 4, 3))
    positions[:, 1, 0] = 0.001 * np.arange(5)  # one joint of four moves at 0.06 m/s
    everywhere = np.ones(5, dtype=bool)
    assert guards.energy_m2_s2(positions, everywhere) == pytest.approx(0.06**2 / 4)
    positions[3:] += 1.0
    assert guards.energy_m2_s2(positions, np.array([1, 1, 1, 0, 1], dtype=bool)) == pytest.approx(0.06**2 / 4)
    assert np.isnan(guards.energy_m2_s2(positions, np.array([1, 0, 1, 0, 1], dtype=bool)))


@pytest.mark.parametrize(
    ("c", "d", "distance"),
    [
        ((0.5, 1, 0), (0.5, 2, 0), 1.0),  # one end before the middle of the other segment
        ((2, 1, 0), (2, -1, 0), 1.0),  # beyond its end
        ((0.5, 1, 0.3), (0.5, -1, 0.3), 0.3),  # crossing at a distance
        ((3, 4, 0), (4, 4, 0), np.hypot(2, 4)),  # both ends
        ((-1, 0.2, 0), (2, 0.2, 0), 0.2),  # parallel
    ],
)
def test_the_distance_of_segments(c, d, distance):
    a, b = np.array([0.0, 0, 0]), np.array([1.0, 0, 0])
    found = [guards.segment_distance(a, b, np.array(c, float), np.array(d, float))]
    found.append(guards.segment_distance(np.array(d, float), np.array(c, float), a, b))
    np.testing.assert_allclose(found, distance)


def test_crossed_fingers_overlap_and_straight_ones_hardly_do():
    crossed = FLAT.copy()
    index, middle = HAND.fingers[1], HAND.fingers[2]
    crossed[list(index[1:])] = FLAT[list(middle[1:])] + [0.0, 0.003, 0.0]
    flat, through = guards.self_overlap_m(HAND, np.stack([FLAT, crossed]))
    assert flat < 0.006
    assert through > 0.012


def test_segments_of_one_finger_are_no_pair():
    first, second = guards.finger_pairs(HAND)
    assert len(first) == 3 * 3 * 10
    for one, other in zip(HAND.capsules[first], HAND.capsules[second], strict=True):
        assert not set(one.tolist()) & set(other.tolist())
