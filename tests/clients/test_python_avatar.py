"""The hand of an avatar in the Python client: its profile, and the pose of its bones for a message."""

import json

import numpy as np
import pytest
from manipnet_client.avatar import (
    FIRST_JOINTS,
    JOINTS,
    TIP_JOINTS,
    WRIST,
    AvatarError,
    AvatarHand,
    RigHand,
    avatar_profile,
)
from manipnet_client.message import Hand
from test_retarget import foreign_rig

from manipnet.geometry import compose, quat_conjugate, quat_exp, quat_rotate
from manipnet.synthesis.hand.profile import parse_profile


def rig_hand(side: str, rng: np.random.Generator, without: tuple[int, ...] = ()) -> RigHand:
    """A hand of other proportions with bent fingers and any axes, and without some rows of bones."""
    positions, rotations, tips, _ = foreign_rig(side, rng, mirrored=False)
    positions[list(without)], rotations[list(without)] = np.nan, np.nan
    return RigHand(positions, rotations, tips)


def message_of(avatar: AvatarHand, rng: np.random.Generator) -> Hand:
    """A hand of a message that the server could send for this avatar: its joints at a random pose."""
    joints = avatar.joints.copy()
    for first, tip in zip(FIRST_JOINTS, TIP_JOINTS, strict=True):
        there = [joint for joint in range(first, tip + 1) if not np.isnan(joints[joint, 0])]
        for number in range(len(there) - 1):
            here = joints[there[number]].copy()
            turn = compose(
                np.append(here[:3], [0.0, 0, 0, 1]), np.append(np.zeros(3), quat_exp(rng.normal(size=3) / 2))
            )
            turn = compose(turn, np.append(-here[:3], [0.0, 0, 0, 1]))
            for joint in there[number:]:
                joints[joint] = compose(turn, joints[joint])
        for joint in range(first, tip + 1):
            if np.isnan(joints[joint, 0]):
                joints[joint] = joints[joint - 1]
    place = np.append(rng.normal(size=3), quat_exp(rng.normal(size=3)))
    joints = compose(place, joints)
    return Hand("live", None, 1.0, np.zeros(20), np.zeros((17, 4)), joints[WRIST], joints)


def shown_tips(rig: RigHand, avatar: AvatarHand, hand: Hand) -> np.ndarray:
    """The ends of the rig's fingers in the world, `(5, 3)`, when its bones have the rotations of the avatar."""
    rotations, turn = avatar.solve(hand), avatar.hand_rotation(hand)
    tips = np.empty((5, 3))
    for finger in range(5):
        rows = [row for row in range(3 * finger, 3 * finger + 3) if not np.isnan(rig.positions[row, 0])]
        at = rig.positions[rows[0]]
        for row, end in zip(rows, [*rig.positions[rows[1:]], rig.tips[finger]], strict=True):
            way = quat_rotate(quat_conjugate(rig.rotations[row]), end - rig.positions[row])
            at = at + quat_rotate(rotations[row], way)
        tips[finger] = avatar.hand_place(hand) + quat_rotate(turn, at)
    return tips


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("without", [(), (5,), (11, 14, 2), (4,)])
def test_fingertips_lie_where_the_message_says(side, without):
    rng = np.random.default_rng(len(without))
    rig = rig_hand(side, rng, without)
    avatar = AvatarHand(side, rig)
    for _ in range(3):
        hand = message_of(avatar, rng)
        np.testing.assert_allclose(shown_tips(rig, avatar, hand), hand.joints[list(TIP_JOINTS), :3], atol=1e-6)


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_server_takes_the_profile(side):
    rng = np.random.default_rng(5)
    profile = avatar_profile("My avatar: Ünal", {side: AvatarHand(side, rig_hand(side, rng, (8,)))})
    taken = parse_profile(json.loads(json.dumps(profile)))
    assert taken.name == profile["name"]
    assert taken.name.startswith("My-avatar---nal-")
    joints = taken.hands[side].joints
    assert np.isnan(joints[JOINTS[8]]).all()
    fingers = joints[[7, 12, 17, 22], :3]
    assert (fingers[:, 2] < 0.0).all()


def test_the_name_depends_on_the_hands_and_the_actor_alone():
    hands = [AvatarHand("right", rig_hand("right", np.random.default_rng(seed))) for seed in (1, 1, 2)]
    same, again, other = (avatar_profile("Rig", {"right": hand})["name"] for hand in hands)
    assert same == again != other
    assert avatar_profile("Rig", {"right": hands[0]}, "Ben")["name"] != same


def test_a_hand_that_is_none_is_refused_with_the_reason():
    rng = np.random.default_rng(3)
    rig = rig_hand("right", rng)
    with pytest.raises(AvatarError, match="wrong side"):
        AvatarHand("left", rig)
    scattered = RigHand(rng.normal(size=(15, 3)), rig.rotations, rig.tips)
    with pytest.raises(AvatarError, match="side by side"):
        AvatarHand("right", scattered)
    with pytest.raises(AvatarError, match="two fingers"):
        AvatarHand("right", rig_hand("right", rng, (0, 3, 6, 9)))
