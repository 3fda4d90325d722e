"""Fingers that overlap, against the evaluation's measure."""

import numpy as np
import pytest
from compiled import call
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.ik.overlap import finger_overlap
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet_tools.evaluation.guards import self_overlap_m

HAND = shipped_hand()
LOW, HIGH = HAND.limits.T


@given(arrays(np.float64, 20, elements=st.floats(0.0, 1.0)))
def test_the_deepest_overlap_is_that_of_the_evaluation(fraction):
    positions = forward_kinematics(HAND, LOW + fraction * (HIGH - LOW))[0]
    overlaps = sorted(call(finger_overlap, HAND.chains, finger, positions) for finger in range(5))
    assert overlaps[-1] == pytest.approx(self_overlap_m(HAND, positions[None])[0], abs=1e-9)
    assert overlaps[-2] == pytest.approx(overlaps[-1], abs=1e-9), "both fingers see it"


def test_a_finger_that_leaves_the_others_does_not_overlap():
    angles = np.zeros(20)
    angles[[9, 13, 17]] = LOW[[9, 13, 17]]
    angles[[6, 7]] = HIGH[[6, 7]]
    angles[5] = HIGH[5]
    positions = forward_kinematics(HAND, angles)[0]
    assert call(finger_overlap, HAND.chains, 1, positions) < 1e-3
