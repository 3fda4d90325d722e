"""A model is evaluated on the hand that was captured, whatever hand it was trained for."""

import numpy as np

from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.hand.validation import check_hand
from manipnet.synthesis.model.bundle import load_bundle
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet_tools.evaluation.roll_outs import posing
from manipnet_tools.generate.free_hand import free_hand


def test_a_model_of_the_captured_hand_is_evaluated_as_it_is():
    bundle = load_bundle()
    assert posing(bundle, shipped_hand()) is bundle


def test_a_model_of_another_hand_poses_the_captured_one():
    bundle, free = load_bundle(), free_hand()
    posed = posing(bundle, free)
    check_hand(posed.hand)
    low, high = free.limits.T
    angles = np.random.default_rng(0).uniform(low, high, (20, free.angle_count))
    ours, theirs = (forward_kinematics(hand, angles)[0] for hand in (posed.hand, free))
    np.testing.assert_allclose(ours, theirs, atol=1e-9)
    ours, theirs = (forward_kinematics(hand, bundle.rest_angles)[1] for hand in (posed.hand, bundle.hand))
    np.testing.assert_allclose(ours, theirs, atol=1e-9)
    assert ((posed.limits[:, 0] <= posed.rest_angles) & (posed.rest_angles <= posed.limits[:, 1])).all()
