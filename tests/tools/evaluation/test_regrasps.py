"""Contacts against several right answers, on cases counted by hand."""

import numpy as np
import pytest

from manipnet.synthesis.model.shipped import shipped_hand
from manipnet_tools.evaluation import metrics, regrasps
from manipnet_tools.evaluation.metrics import Gaps

HAND = shipped_hand()


def touching(rows) -> Gaps:
    """A capsule for each digit: 1 where it touches."""
    gap = np.where(np.array([[digit == "1" for digit in row] for row in rows]), 0.0, 0.1)
    return Gaps(gap, np.zeros((*gap.shape, 3)), np.zeros((*gap.shape, 3)))


def test_the_same_wrist_pose_at_another_moment_is_an_answer():
    p_object = np.zeros((120, HAND.joint_count, 3))
    p_object[:, :, 0] = np.arange(120)[:, None]
    p_object[100, :, 0] = 10.0  # the hand comes back to where it was at frame 10 ...
    p_object[100, HAND.fingers[1][1:], 1] = 0.05  # ... with other fingers
    p_object[11, :, 0] = 10.004  # 4 mm away, but a moment later
    p_object[50, :, 0] = 10.012
    answers = regrasps.regrasps(HAND, p_object)
    assert answers[10].tolist() == [10, 100]
    assert answers[100].tolist() == [10, 11, 50, 100] or answers[100].tolist() == [10, 11, 100]
    assert answers[30].tolist() == [30]


def test_each_frame_is_compared_with_the_answer_that_fits_best():
    captured, ours = touching(["110", "011"]), touching(["011", "011"])
    alone = [np.array([0]), np.array([1])]
    either = [np.array([0, 1]), np.array([1])]
    everywhere = np.ones(2, dtype=bool)
    assert regrasps.contact_f1(ours, captured, alone, everywhere) == metrics.contact_f1(ours, captured) == 0.75
    assert regrasps.contact_f1(ours, captured, either, everywhere) == 1.0
    assert regrasps.contact_f1(ours, captured, alone, np.array([False, True])) == 1.0


def test_touching_nothing_is_right_only_where_an_answer_touches_nothing():
    captured, nothing = touching(["110", "000"]), touching(["000", "000"])
    first = np.array([True, False])
    assert regrasps.contact_f1(nothing, captured, [np.array([0]), np.array([1])], first) == 0.0
    assert np.isnan(regrasps.contact_f1(nothing, captured, [np.array([0, 1]), np.array([1])], first))


def test_touching_everywhere_does_not_win():
    captured, everything = touching(["1000"]), touching(["1111"])
    assert regrasps.contact_f1(everything, captured, [np.array([0])], np.array([True])) == pytest.approx(0.4)


def test_recall_counts_fingers_and_not_capsules():
    capsules = {finger: np.flatnonzero(np.isin(HAND.capsules, HAND.fingers[finger]).all(axis=1)) for finger in range(5)}
    captured, ours = (Gaps(np.full((1, len(HAND.radii)), 0.1), np.zeros(()), np.zeros(())) for _ in range(2))
    captured.gap[0, capsules[0]] = captured.gap[0, capsules[2]] = 0.0
    ours.gap[0, capsules[0][-1]] = ours.gap[0, capsules[3]] = 0.0
    assert regrasps.finger_recall(HAND, ours, captured) == 0.5
    palm = Gaps(np.where(HAND.capsules[:, 0] == 0, 0.0, 0.1)[None], np.zeros(()), np.zeros(()))
    assert not regrasps.touching_fingers(HAND, palm).any()
    assert np.isnan(regrasps.finger_recall(HAND, ours, palm))
