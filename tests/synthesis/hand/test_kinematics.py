"""Kinematics: properties, and an independent forward pass by plain quaternions."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from manipnet import geometry
from manipnet.synthesis.hand.kinematics import angles_from_rotations, forward_kinematics
from manipnet.synthesis.model.shipped import shipped_hand

HAND = shipped_hand()

fractions = arrays(np.float64, HAND.angle_count, elements=st.floats(0.0, 1.0))


def inside_limits(fraction):
    low, high = HAND.limits.T
    return low + fraction * (high - low)


def slow_forward(angles):
    positions, quats = np.zeros((22, 3)), np.zeros((17, 4))
    quats[0] = [0, 0, 0, 1]
    for joint in range(1, 22):
        parent = HAND.parents[joint]
        positions[joint] = positions[parent] + geometry.quat_rotate(quats[parent], HAND.offsets[joint])
        if joint < 17:
            turn = quats[parent]
            for dof in np.flatnonzero(joint == HAND.angle_bones):
                turn = geometry.quat_multiply(turn, geometry.quat_exp(HAND.axes[dof] * angles[dof]))
            quats[joint] = geometry.quat_multiply(turn, HAND.rest_quats[joint])
    return positions, geometry.quat_to_matrix(quats)


@given(fractions)
def test_forward_kinematics_agrees_with_quaternions(fraction):
    angles = inside_limits(fraction)
    positions, rotations = forward_kinematics(HAND, angles)
    slow_positions, slow_rotations = slow_forward(angles)
    np.testing.assert_allclose(positions, slow_positions, atol=1e-12)
    np.testing.assert_allclose(rotations, slow_rotations, atol=1e-12)


@given(fractions)
def test_angles_come_back_from_rotations(fraction):
    angles = inside_limits(fraction)
    np.testing.assert_allclose(angles_from_rotations(HAND, forward_kinematics(HAND, angles)[1]), angles, atol=1e-9)


@given(fractions)
def test_bones_keep_their_length(fraction):
    positions, _ = forward_kinematics(HAND, inside_limits(fraction))
    bones = np.linalg.norm(positions[1:] - positions[HAND.parents[1:]], axis=1)
    np.testing.assert_allclose(bones, np.linalg.norm(HAND.offsets[1:], axis=1), atol=1e-12)


def test_angle_zero_is_the_flat_hand():
    positions, _ = forward_kinematics(HAND, np.zeros(HAND.angle_count))
    for root, *_, tip in HAND.fingers[1:]:
        reach = positions[tip] - positions[root]
        assert reach[0] / np.linalg.norm(reach) > 0.99


def test_flexion_bends_toward_the_palm_and_abduction_toward_the_thumb():
    for finger, joints in enumerate(HAND.fingers[1:], start=1):
        for dof in range(4 * finger, 4 * finger + 4):
            angles = np.zeros(HAND.angle_count)
            angles[dof] = 0.2
            moved = (
                forward_kinematics(HAND, angles)[0][joints[-1]]
                - forward_kinematics(HAND, np.zeros(HAND.angle_count))[0][joints[-1]]
            )
            if HAND.angle_names[dof].endswith("AA"):
                assert moved[1] > 0.005
            else:
                assert moved[2] < -0.003


def test_leading_shapes_are_kept():
    angles = np.zeros((2, 3, HAND.angle_count))
    positions, rotations = forward_kinematics(HAND, angles)
    assert positions.shape == (2, 3, 22, 3)
    assert rotations.shape == (2, 3, 17, 3, 3)
    assert angles_from_rotations(HAND, rotations).shape == (2, 3, HAND.angle_count)
