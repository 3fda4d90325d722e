"""An avatar's hand made from a profile: rest pose, angles, missing joints."""

import numpy as np
import pytest
from avatar_profiles import scaled_profile

from manipnet.geometry import SIDES, compose, quat_exp, quat_multiply
from manipnet.synthesis.carrying import HandCarrier
from manipnet.synthesis.hand.avatar import avatar_hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.hand.model_profile import OUR_JOINTS, model_profile
from manipnet.synthesis.hand.profile import FINGERS, ProfileHand
from manipnet.synthesis.hand.validation import check_hand
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.wire.hand_names import OPENXR_JOINT_NAMES, OPENXR_PARENTS

MODEL = shipped_hand()
WRIST = np.array([0.1, 1.0, -0.2, *quat_exp(np.array([0.3, -0.8, 0.5]))])


def bone_lengths(joints):
    return np.array([np.linalg.norm(joints[k, :3] - joints[p, :3]) for k, p in enumerate(OPENXR_PARENTS) if p >= 0])


@pytest.mark.parametrize("side", SIDES)
def test_the_models_own_hand_follows_its_angles(side):
    avatar = avatar_hand(model_profile(MODEL, side), side, MODEL)
    check_hand(avatar.hand)
    angles = np.full(MODEL.angle_count, 0.2)
    angles[:2] = 0.0  # the model's thumb starts nearer to the wrist, which a bone that is one with the palm cannot
    ours, _ = forward_kinematics(avatar.hand, avatar.follow @ angles)
    theirs, _ = forward_kinematics(MODEL, angles)
    names = [OUR_JOINTS[OPENXR_JOINT_NAMES.index(name)] for name in avatar.hand.joint_names[1:]]
    np.testing.assert_allclose(ours[1:], theirs[names], atol=5e-4)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("turns", [(0.0, 0.0), (0.3, -0.4)])
def test_any_rest_pose_of_the_fingers_is_undone(side, turns):
    """A hand that rests with spread or bent knuckles ends in the same pose for the same angles."""
    straight = model_profile(MODEL, side)
    joints = straight.joints.copy()
    for n, row in enumerate(FINGERS[1:]):
        root = joints[row[1]].copy()
        turn = np.array([turns[0], (n - 1.5) * 0.3 * turns[1], 0.0])
        bent = np.concatenate([np.zeros(3), quat_exp(turn)])
        for k in row[1:]:
            local = np.concatenate([joints[k, :3] - root[:3], joints[k, 3:]])
            joints[k] = compose(bent, local)
            joints[k, :3] += root[:3]
    angles = np.full(MODEL.angle_count, 0.1)
    poses = [
        HandCarrier(avatar_hand(ProfileHand(each, straight.radii), side, MODEL), MODEL, side).step(angles, WRIST, None)
        for each in (straight.joints, joints)
    ]
    np.testing.assert_allclose(poses[1].joints[:, :3], poses[0].joints[:, :3], atol=2e-3)


@pytest.mark.parametrize("side", SIDES)
def test_turns_of_the_bones_lead_from_the_rest_pose_to_the_joints(side):
    profile, rng = scaled_profile(MODEL, 0.9).hands[side], np.random.default_rng(0)
    for k in range(2, 26):  # frames that do not lie along the bones
        profile.joints[k, 3:] = quat_multiply(profile.joints[k, 3:], quat_exp(rng.uniform(-0.2, 0.2, 3)))
    avatar = avatar_hand(profile, side, MODEL)
    pose = HandCarrier(avatar, MODEL, side).step(np.full(MODEL.angle_count, 0.3), WRIST, None)
    np.testing.assert_allclose(bone_lengths(pose.joints), bone_lengths(profile.joints), atol=1e-6)
    for row in FINGERS:
        chain = list(row if row is FINGERS[0] else row[1:])
        world, rest_before = pose.joints[1], profile.joints[1]
        for bone, k in zip(
            range(2 if row is FINGERS[0] else 5 + 3 * (FINGERS.index(row) - 1), 99), chain[:-1], strict=False
        ):
            local = compose(
                np.concatenate([-_turned_back(rest_before), rest_before[3:] * [-1, -1, -1, 1]]), profile.joints[k]
            )
            world = compose(world, compose(local, np.concatenate([np.zeros(3), pose.rotations[bone]])))
            rest_before = profile.joints[k]
            np.testing.assert_allclose(world[:3], pose.joints[k, :3], atol=1e-6)
            assert abs(world[3:] @ pose.joints[k, 3:]) == pytest.approx(1.0, abs=1e-6)


def _turned_back(pose):
    from manipnet.geometry import quat_conjugate, quat_rotate

    return quat_rotate(quat_conjugate(pose[3:]), pose[:3])


def test_turns_that_say_nothing_about_the_back_of_a_finger_are_replaced():
    own = model_profile(MODEL, "right")
    joints = own.joints.copy()
    joints[:, 3:] = quat_exp(np.array([np.pi / 2, 0.0, 0.0]))  # +y along the fingers
    joints[1, 3:] = [0.0, 0.0, 0.0, 1.0]
    avatar = avatar_hand(ProfileHand(joints, own.radii), "right", MODEL)
    pose = HandCarrier(avatar, MODEL, "right").step(np.full(MODEL.angle_count, 0.2), WRIST, None)
    np.testing.assert_allclose(np.linalg.norm(pose.joints[:, 3:], axis=1), 1.0, atol=1e-6)


@pytest.mark.parametrize(
    "missing",
    [
        (*FINGERS[3], *FINGERS[4]),
        FINGERS[0],
        (2,),
        (9, 14, 19, 24),
        (8, 9, 13, 14, 18, 19, 23, 24),
        (10, 15, 20, 25),
        (0, 6, 11, 16, 21),
    ],
    ids=["three fingers", "no thumb", "no thumb metacarpal", "no distal", "one bone", "no tips", "no palm"],
)
@pytest.mark.parametrize("side", SIDES)
def test_a_hand_without_some_joints_is_served_with_what_is_there(side, missing):
    own = model_profile(MODEL, side)
    joints = own.joints.copy()
    joints[list(missing)] = np.nan
    avatar = avatar_hand(ProfileHand(joints, np.full(26, np.nan)), side, MODEL)
    check_hand(avatar.hand)
    assert avatar.guessed
    assert np.isfinite(avatar.radii).all()
    pose = HandCarrier(avatar, MODEL, side).step(np.full(MODEL.angle_count, 0.2), WRIST, None)
    assert np.isfinite(pose.joints).all()
    assert np.isfinite(pose.rotations).all()
    there = ~np.isnan(joints[:, 0])
    kept = [k for k in range(26) if there[k] and OPENXR_PARENTS[k] >= 0 and there[OPENXR_PARENTS[k]]]
    for k in kept:
        length = np.linalg.norm(pose.joints[k, :3] - pose.joints[OPENXR_PARENTS[k], :3])
        assert length == pytest.approx(np.linalg.norm(joints[k, :3] - joints[OPENXR_PARENTS[k], :3]), abs=1e-6)
