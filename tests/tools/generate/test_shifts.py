"""What a hand does while it holds: objects that move in the hand, and other grips."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from manipnet.geometry import Array, quat_exp
from manipnet_tools.assets.minimum_jerk import Move, superpose
from manipnet_tools.generate.bank import Held
from manipnet_tools.generate.shifts import HANDS_APART_M, drawn_shifts, regrip, there_and_back

BACK = np.array([0.0, 0.0, 1.0])


def pose(x: float, turn: float = 0.0) -> Array:
    return np.concatenate([[x, 0.0, 0.0], quat_exp(np.array([0.0, turn, 0.0]))])


def held(x: float, angle: float, **changes) -> Held:
    way = tuple((pose(x + 0.005 * k, 0.1 * k), np.full(20, angle + 0.01 * k)) for k in range(1, 6))
    joints = np.array([[x, 0.0, 0.0], [x, 0.05, 0.0]])
    grasp = Held(
        "right", "palm", pose(x), np.full(20, angle), np.full(20, angle - 0.4), BACK, np.eye(3), joints, 5, (way,)
    )
    return replace(grasp, **changes)


def test_an_object_moves_along_its_way_and_comes_back():
    grasp = held(0.0, 0.5)
    shifts = there_and_back(1.0, 0.1, grasp, grasp.ways[0])
    assert len(shifts) == 10
    assert all(after.start_s < before.end_s for before, after in itertools.pairwise(shifts))
    time_s = np.linspace(0.9, shifts[-1].end_s, 60)
    poses = superpose(time_s, grasp.pose, [Move(shift.start_s, shift.end_s, shift.pose) for shift in shifts])
    assert 0.015 < poses[:, 0].max() <= 0.025 + 1e-9
    np.testing.assert_allclose(poses[-1], grasp.pose, atol=1e-9)
    assert shifts[-1].angles is grasp.angles


def test_a_hand_leaves_the_object_and_opens_on_the_way_to_another_grip():
    before, after = held(0.0, 0.5), held(0.04, 0.7, pose=pose(0.04, 0.8))
    between, there = regrip(2.0, 0.5, before, after, opened=0.5)
    assert (between.start_s, there.end_s) == (2.0, 2.5)
    np.testing.assert_allclose(between.pose, [0.02, 0.0, 0.015, *quat_exp(np.array([0.0, 0.4, 0.0]))], atol=1e-9)
    np.testing.assert_allclose(between.angles, 0.6 - 0.5 * 0.4)
    assert there.pose is after.pose
    assert there.angles is after.angles


def test_shifts_are_over_before_the_hand_lets_go():
    grasps = [held(0.0, 0.5), held(0.03, 0.6)]
    for seed in range(20):
        rng = np.random.default_rng(seed)
        shifts = drawn_shifts(grasps, grasps[0], 1.0, 4.0, None, rng)
        assert shifts
        assert min(shift.start_s for shift in shifts) > 1.0
        assert max(shift.end_s for shift in shifts) < 3.95


@pytest.mark.parametrize(("beside_x", "goes"), [(0.5, True), (0.03 + 0.5 * HANDS_APART_M, False)])
def test_another_grip_leaves_the_other_hand_its_place(beside_x: float, goes: bool):
    grasps = [held(0.0, 0.5), held(0.03, 0.6)]
    beside = held(beside_x, 0.5, side="left")
    poses = [
        shift.pose[0]
        for seed in range(10)
        for shift in drawn_shifts(grasps, grasps[0], 1.0, 6.0, beside, np.random.default_rng(seed))
    ]
    assert bool(max(poses) > 0.026) == goes


def test_hands_that_hold_only_together_keep_their_grips():
    pair = [held(0.0, 0.5, pair=0), held(0.03, 0.6, pair=1)]
    shifts = drawn_shifts(pair, pair[0], 1.0, 6.0, None, np.random.default_rng(0))
    assert max(shift.pose[0] for shift in shifts) <= 0.025 + 1e-9
