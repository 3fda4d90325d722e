"""VMC with an avatar: a receiver that sets the positions and rotations of its bones shows the hand that was solved."""

import contextlib
import socket
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from avatar_profiles import as_content, scaled_profile
from make_vectors import messages
from pythonosc.osc_bundle import OscBundle

from manipnet.geometry import SIDES, Side, compose, matrix_to_quat, quat_exp, quat_multiply, quat_rotate
from manipnet.outputs.axes import to_unity
from manipnet.outputs.declaration import EncodedHands
from manipnet.outputs.vmc.sender import VmcSender
from manipnet.synthesis.carrying import HandCarrier
from manipnet.synthesis.hand.avatar import avatar_hand
from manipnet.synthesis.hand.profile import FINGERS, HandProfile, ProfileError, ProfileHand, parse_profile
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.wire import HandPose

MODEL = shipped_hand()
PARTS = ("Proximal", "Intermediate", "Distal")
ROWS = {
    finger: row[:4] if finger == "Thumb" else row[1:5]
    for finger, row in zip(("Thumb", "Index", "Middle", "Ring", "Little"), FINGERS, strict=True)
}
"""The OpenXR joints at the starts of the three bones that VMC knows of each finger, and its tip."""


def with_t_pose(profile: HandProfile, bend_rad=0.3, tilt=(0.1, 0.2, -0.15)) -> HandProfile:
    """The profile of an avatar whose T-pose has bent fingers and a tilted palm."""
    hands = {}
    for side, hand in profile.hands.items():
        along = 1.0 if side == "left" else -1.0
        palm = np.array([[0.0, 0.0, -along], [0.0, 1.0, 0.0], [along, 0.0, 0.0]])
        places = hand.joints[:, :3].copy()
        for row in ROWS.values():
            turn = np.array([0.0, 0.0, 0.0, 1.0])
            for a, b in pairwise([k for k in row if not np.isnan(hand.joints[k, 0])]):
                side_axis = quat_rotate(hand.joints[a, 3:], np.array([1.0, 0.0, 0.0]))
                turn = quat_multiply(turn, quat_exp(-bend_rad * side_axis))
                places[b] = places[a] + quat_rotate(turn, hand.joints[b, :3] - hand.joints[a, :3])
        signs = np.array([1.0, along, along])
        t_pose = quat_rotate(quat_exp(signs * tilt), places @ palm.T)
        hands[side] = ProfileHand(hand.joints, hand.radii, t_pose, np.array([-along * 0.22, 0.01, -0.02]))
    return HandProfile(profile.name, hands)


def t_pose_of(profile: HandProfile, side: Side) -> np.ndarray:
    t_pose = profile.hands[side].t_pose
    assert t_pose is not None
    return t_pose


def without(profile: HandProfile, *joints: int) -> HandProfile:
    hands = {}
    for side, hand in profile.hands.items():
        poses = hand.joints.copy()
        poses[list(joints)] = np.nan
        hands[side] = replace(hand, joints=poses)
    return HandProfile(profile.name, hands)


def solved(profile: HandProfile, seed: int) -> dict[str, HandPose]:
    """Both hands of the avatar somewhere in the world, with some angles of the model's."""
    rng = np.random.default_rng(seed)
    hands = {}
    for side in SIDES:
        wrist = np.concatenate([rng.normal(size=3), quat_exp(rng.normal(size=3))])
        angles = rng.uniform(*MODEL.limits.T)
        pose = HandCarrier(avatar_hand(profile.hands[side], side, MODEL), MODEL, side).step(angles, wrist, None)
        hands[side] = HandPose("live", None, 1.0, np.zeros(20), pose.rotations, pose.wrist, pose.joints)
    return hands


def sent(profile: HandProfile, hands, **options) -> dict[str, np.ndarray]:
    """The bones that a receiver gets, `(7,)` by name. Each datagram fits a packet."""
    message = replace(messages()["live"], hands=hands, hand=profile.name)
    bones = {}
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.setblocking(False)
        sender = VmcSender(
            "127.0.0.1", receiver.getsockname()[1], MODEL, avatars={message.actor: profile.name}, **options
        )
        assert not sender.send(EncodedHands(message))
        assert sender.wants(profile.name)
        assert sender.send_avatar(EncodedHands(message), profile)
        sender.close()
        with contextlib.suppress(BlockingIOError):
            while True:
                datagram = receiver.recv(4096)
                assert len(datagram) <= 1472
                addresses = [m.address for m in OscBundle(datagram)]
                assert addresses[:2] == ["/VMC/Ext/OK", "/VMC/Ext/T"]
                assert addresses[-1] == "/VMC/Ext/Blend/Apply"
                bones |= {m.params[0]: np.array(m.params[1:]) for m in OscBundle(datagram) if "Bone" in m.address}
    return bones


def shown(bones, side: str, tips) -> dict[int, np.ndarray]:
    """Where a receiver in Unity's axes has the joints, from the hand on, whose parent is turned as the world."""
    hand = bones[f"{side.capitalize()}Hand"]
    places = {1: np.zeros(3)}
    for finger, row in ROWS.items():
        at, turn = np.zeros(3), hand[3:]
        for part, joint in zip(PARTS, row[:3], strict=True):
            bone = bones.get(f"{side.capitalize()}{finger}{part}")
            if bone is not None:
                at, turn = at + quat_rotate(turn, bone[:3]), quat_multiply(turn, bone[3:])
                places[joint] = at
        if row[0] in places:
            places[row[3]] = at + quat_rotate(turn, tips[row[3]])
    return places


def compare(t_poses, hands, bones):
    for side, pose in hands.items():
        unity = to_unity(np.hstack([t_poses[side], np.tile([0, 0, 0, 1.0], (26, 1))]))[:, :3]
        last = {row[3]: max((k for k in row[:3] if not np.isnan(unity[k, 0])), default=1) for row in ROWS.values()}
        tips = {tip: unity[tip] - unity[bone] for tip, bone in last.items()}
        world = to_unity(pose.joints)
        for joint, place in shown(bones, side, tips).items():
            assert np.linalg.norm(place - (world[joint, :3] - world[1, :3])) < 1e-4


def default_t_pose(hand: ProfileHand, side: str) -> np.ndarray:
    along = 1.0 if side == "left" else -1.0
    return hand.joints[:, :3] @ np.array([[0.0, 0.0, -along], [0.0, 1.0, 0.0], [along, 0.0, 0.0]]).T


LONG = scaled_profile(MODEL, 1.15, 0.9, name="long")
THREE = (*FINGERS[3], *FINGERS[4][2:3])
"""The joints of a ring finger, and one inside the little finger."""


@pytest.mark.parametrize("missing", [(), THREE], ids=["whole", "three fingers"])
def test_the_receiver_shows_the_hand_that_was_solved(missing):
    profile = without(LONG, *missing)
    for seed in range(3):
        hands = solved(profile, seed)
        compare(
            {side: default_t_pose(hand, side) for side, hand in profile.hands.items()},
            hands,
            sent(profile, hands),
        )


@pytest.mark.parametrize("missing", [(), THREE], ids=["whole", "three fingers"])
def test_an_avatar_with_another_t_pose_keeps_its_bones_and_shows_the_hand(missing):
    profile = with_t_pose(without(LONG, *missing))
    hands = solved(profile, 7)
    bones = sent(profile, hands)
    compare({side: t_pose_of(profile, side) for side in SIDES}, hands, bones)
    t_pose = t_pose_of(profile, "right")
    own = (t_pose[8] - t_pose[7]) * [-1.0, 1.0, 1.0]
    np.testing.assert_allclose(bones["RightIndexIntermediate"][:3], own, atol=1e-6)
    np.testing.assert_allclose(bones["RightHand"][:3], [0.22, -0.01, 0.02], atol=1e-6)


def test_a_hand_in_its_t_pose_is_sent_without_turns():
    profile = with_t_pose(LONG, bend_rad=0.0)
    hands = {}
    for side, hand in profile.hands.items():
        t_pose = t_pose_of(profile, side)
        u, _, v = np.linalg.svd(t_pose[[7, 12, 22]].T @ hand.joints[[7, 12, 22], :3])
        turn = matrix_to_quat(u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v)
        wrist = np.array([0.0, 1.0, 0.0, *turn])
        still = np.tile([0.0, 0.0, 0.0, 1.0], (17, 1))
        hands[side] = HandPose("live", None, 1.0, np.zeros(20), still, wrist, compose(wrist, hand.joints))
    for pose in sent(profile, hands).values():
        np.testing.assert_allclose(pose[3:] * np.sign(pose[6]), [0, 0, 0, 1], atol=1e-5)


def test_missing_bones_are_not_sent():
    names = set(sent(without(LONG, *THREE), solved(LONG, 1)))
    assert not {name for name in names if "Ring" in name}
    assert {"LeftLittleProximal", "LeftLittleDistal", "RightHand"} <= names
    assert "LeftLittleIntermediate" not in names


def test_fingers_only_leave_the_hand_out():
    assert not {"LeftHand", "RightHand"} & set(sent(LONG, solved(LONG, 1), fingers_only=True))


def test_a_replaced_profile_is_shown_with_its_own_bones():
    hands, other = solved(LONG, 1), scaled_profile(MODEL, 0.8, name="long")
    first, second = sent(LONG, hands), sent(other, solved(other, 1))
    assert np.linalg.norm(second["RightIndexDistal"][:3]) < 0.8 * np.linalg.norm(first["RightIndexDistal"][:3])


def content(**hand):
    profile = with_t_pose(LONG)
    whole = as_content(profile)
    for side in SIDES:
        whole[side] |= {"t_pose": t_pose_of(profile, side).tolist(), "elbow": [0.2, 0.0, 0.0]}
    whole["left"] |= hand
    return whole


def test_a_profile_may_describe_the_t_pose():
    profile, expected = parse_profile(content()), with_t_pose(LONG)
    for side in SIDES:
        np.testing.assert_allclose(t_pose_of(profile, side), t_pose_of(expected, side))
    one = content()
    del one["right"]
    mirrored = parse_profile(one)
    np.testing.assert_allclose(t_pose_of(mirrored, "right")[:, 0], -t_pose_of(expected, "left")[:, 0])
    elbow = mirrored.hands["right"].elbow
    assert elbow is not None
    np.testing.assert_allclose(elbow, [-0.2, 0.0, 0.0])


@pytest.mark.parametrize(
    ("hand", "reason"),
    [
        ({"t_pose": 3}, "t_pose must be a list of 26 positions"),
        ({"t_pose": [[0, 0, 0]] * 26}, "bones of both must have the same lengths"),
        ({"t_pose": [None] * 26}, "t_pose lacks joint 2"),
        ({"t_pose": [[float("nan"), 0, 0]] * 26}, "at most 1.5"),
        ({"t_pose": [["a", 0, 0]] * 26}, "must be 3 numbers"),
        ({"elbow": [1e9, 0, 0]}, "at most 1.5"),
        ({"elbow": {}}, "elbow must be 3 numbers"),
    ],
)
def test_a_wrong_t_pose_is_refused_with_the_reason(hand, reason):
    with pytest.raises(ProfileError, match=reason):
        parse_profile(content(**hand))
