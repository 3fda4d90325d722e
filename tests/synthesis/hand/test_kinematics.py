"""Kinematics: properties, and an independent forward pass by plain quaternions."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from manipnet import geometry
from manipnet.synthesis.hand.kinematics import angles_from_rotations, forward_kinematics
from manipnet.synthesis.hand.skeleton import (
    DOF_AXES,
    DOF_COUNT,
    DOF_JOINTS,
    DOF_LIMITS_RAD,
    DOF_NAMES,
    FINGER_JOINTS,
    OFFSETS_M,
    PARENTS,
    REST_QUATS,
)

fractions = arrays(np.float64, DOF_COUNT, elements=st.floats(0.0, 1.0))


def inside_limits(fraction):
    low, high = DOF_LIMITS_RAD.T
    return low + fraction * (high - low)


def slow_forward(angles):
    positions, quats = np.zeros((22, 3)), np.zeros((17, 4))
    quats[0] = [0, 0, 0, 1]
    for joint in range(1, 22):
        parent = PARENTS[joint]
        positions[joint] = positions[parent] + geometry.quat_rotate(quats[parent], OFFSETS_M[joint])
        if joint < 17:
            turn = quats[parent]
            for dof in np.flatnonzero(joint == DOF_JOINTS):
                turn = geometry.quat_multiply(turn, geometry.quat_exp(DOF_AXES[dof] * angles[dof]))
            quats[joint] = geometry.quat_multiply(turn, REST_QUATS[joint])
    return positions, geometry.quat_to_matrix(quats)


@given(fractions)
def test_forward_kinematics_agrees_with_quaternions(fraction):
    angles = inside_limits(fraction)
    positions, rotations = forward_kinematics(angles)
    slow_positions, slow_rotations = slow_forward(angles)
    np.testing.assert_allclose(positions, slow_positions, atol=1e-12)
    np.testing.assert_allclose(rotations, slow_rotations, atol=1e-12)


@given(fractions)
def test_angles_come_back_from_rotations(fraction):
    angles = inside_limits(fraction)
    np.testing.assert_allclose(angles_from_rotations(forward_kinematics(angles)[1]), angles, atol=1e-9)


@given(fractions)
def test_bones_keep_their_length(fraction):
    positions, _ = forward_kinematics(inside_limits(fraction))
    bones = np.linalg.norm(positions[1:] - positions[PARENTS[1:]], axis=1)
    np.testing.assert_allclose(bones, np.linalg.norm(OFFSETS_M[1:], axis=1), atol=1e-12)


def test_angle_zero_is_the_flat_hand():
    positions, _ = forward_kinematics(np.zeros(DOF_COUNT))
    for root, *_, tip in FINGER_JOINTS[1:]:
        reach = positions[tip] - positions[root]
        assert reach[0] / np.linalg.norm(reach) > 0.99


def test_flexion_bends_toward_the_palm_and_abduction_toward_the_thumb():
    for finger, joints in enumerate(FINGER_JOINTS[1:], start=1):
        for dof in range(4 * finger, 4 * finger + 4):
            angles = np.zeros(DOF_COUNT)
            angles[dof] = 0.2
            moved = forward_kinematics(angles)[0][joints[-1]] - forward_kinematics(np.zeros(DOF_COUNT))[0][joints[-1]]
            if DOF_NAMES[dof].endswith("AA"):
                assert moved[1] > 0.005
            else:
                assert moved[2] < -0.003


def test_leading_shapes_are_kept():
    angles = np.zeros((2, 3, DOF_COUNT))
    positions, rotations = forward_kinematics(angles)
    assert positions.shape == (2, 3, 22, 3)
    assert rotations.shape == (2, 3, 17, 3, 3)
    assert angles_from_rotations(rotations).shape == (2, 3, DOF_COUNT)
