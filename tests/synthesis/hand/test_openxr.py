"""The OpenXR joints of posed hands: where they are and how they are turned."""

import numpy as np
import pytest

from manipnet.geometry import (
    Array,
    compose,
    mirror_points,
    mirror_poses,
    quat_normalize,
    quat_rotate,
)
from manipnet.synthesis.hand.openxr import pose_in_world
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.wire import Side
from manipnet.wire.hand_names import OPENXR_JOINT_NAMES, OPENXR_PARENTS, WEBXR_JOINT_NAMES

HAND = shipped_hand()

INDEX = {name: i for i, name in enumerate(OPENXR_JOINT_NAMES)}
IDENTITY = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
SIDES = ("left", "right")
FINGERS = ("index", "middle", "ring", "little")
BONES = [("thumb", "metacarpal", "proximal"), ("thumb", "proximal", "distal"), ("thumb", "distal", "tip")]
BONES += [(f, "proximal", "intermediate") for f in FINGERS]
BONES += [(f, "intermediate", "distal") for f in FINGERS]
BONES += [(f, "distal", "tip") for f in FINGERS]


def random_angles(seed: int) -> Array:
    low, high = HAND.limits.T
    return np.random.default_rng(seed).uniform(low, high)


def random_wrist(seed: int) -> Array:
    rng = np.random.default_rng(seed)
    return np.concatenate([rng.normal(size=3), quat_normalize(rng.normal(size=4))])


def joints_of(side: Side, wrist: Array, angles: Array, scale: float = 1.0) -> Array:
    return pose_in_world(HAND, [side], angles[None], wrist[None], scale)[1][0]


def axes(joints: Array, *names: str) -> tuple[Array, Array]:
    """-z and +y of the named joints."""
    q = joints[[INDEX[name] for name in names], 3:]
    return quat_rotate(q, np.array([[0.0, 0.0, -1.0]])), quat_rotate(q, np.array([[0.0, 1.0, 0.0]]))


def test_joint_names_are_those_of_openxr_in_its_order():
    assert len(OPENXR_JOINT_NAMES) == len(set(OPENXR_JOINT_NAMES)) == 26
    assert OPENXR_JOINT_NAMES[:8] == (
        *("palm", "wrist", "thumb_metacarpal", "thumb_proximal", "thumb_distal", "thumb_tip"),
        *("index_metacarpal", "index_proximal"),
    )
    assert OPENXR_JOINT_NAMES[-2:] == ("little_distal", "little_tip")


def test_webxr_names_are_those_of_the_specification():
    assert len(WEBXR_JOINT_NAMES) == 25
    assert WEBXR_JOINT_NAMES[:7] == (
        *("wrist", "thumb-metacarpal", "thumb-phalanx-proximal", "thumb-phalanx-distal", "thumb-tip"),
        *("index-finger-metacarpal", "index-finger-phalanx-proximal"),
    )
    assert WEBXR_JOINT_NAMES[-2:] == ("pinky-finger-phalanx-distal", "pinky-finger-tip")


def test_parents_lead_to_the_wrist_by_name():
    named = {OPENXR_JOINT_NAMES[i]: OPENXR_JOINT_NAMES[p] for i, p in enumerate(OPENXR_PARENTS) if p >= 0}
    assert "wrist" not in named
    assert named["palm"] == named["thumb_metacarpal"] == named["ring_metacarpal"] == "wrist"
    assert named["thumb_tip"] == "thumb_distal"
    assert named["little_tip"] == "little_distal"
    assert named["little_proximal"] == "little_metacarpal"


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("seed", range(5))
def test_minus_z_runs_along_every_bone(side: Side, seed: int):
    joints = joints_of(side, random_wrist(seed), random_angles(seed))
    for finger, start, end in BONES:
        along = joints[INDEX[f"{finger}_{end}"], :3] - joints[INDEX[f"{finger}_{start}"], :3]
        forward, _ = axes(joints, f"{finger}_{start}")
        np.testing.assert_allclose(forward[0], along / np.linalg.norm(along), atol=1e-5)


@pytest.mark.parametrize("side", SIDES)
def test_plus_y_leaves_the_back_of_the_flat_hand(side: Side):
    joints = joints_of(side, IDENTITY, np.zeros(20))
    fingers = [f"{f}_{part}" for f in FINGERS for part in ("metacarpal", "proximal", "intermediate", "distal", "tip")]
    _, up = axes(joints, "palm", "wrist", *fingers)
    assert np.all(up[:, 2] > 0.95)  # the palm faces -z of the wrist frame


@pytest.mark.parametrize("side", SIDES)
def test_flexion_turns_every_bone_away_from_its_plus_y(side: Side):
    for name in ("INDEX", "MIDDLE", "RING", "PINKY", "THUMB"):
        finger = name.lower().replace("pinky", "little")
        for dof in (i for i, d in enumerate(HAND.angle_names) if d.startswith(name) and d.endswith("_FE")):
            if HAND.angle_names[dof] == "THUMB_CMC_FE":
                continue  # rolls the thumb across the palm
            bent = np.zeros(20)
            bent[dof] = 0.1
            before, after = joints_of(side, IDENTITY, np.zeros(20)), joints_of(side, IDENTITY, bent)
            _, back = axes(before, f"{finger}_distal")
            moved = after[INDEX[f"{finger}_tip"], :3] - before[INDEX[f"{finger}_tip"], :3]
            assert moved @ back[0] < -0.9 * np.linalg.norm(moved), HAND.angle_names[dof]


@pytest.mark.parametrize("seed", range(3))
def test_the_left_hand_is_the_mirror_image(seed: int):
    angles, wrist = random_angles(seed), random_wrist(seed)
    right = joints_of("right", wrist, angles)
    left = joints_of("left", mirror_poses(wrist), angles)
    np.testing.assert_allclose(left[:, :3], mirror_points(right[:, :3]), atol=1e-12)
    for of_left, of_right in zip(axes(left, *OPENXR_JOINT_NAMES), axes(right, *OPENXR_JOINT_NAMES), strict=True):
        np.testing.assert_allclose(of_left, mirror_points(of_right), atol=1e-12)


@pytest.mark.parametrize("side", SIDES)
def test_quaternions_are_unit(side: Side):
    joints = joints_of(side, random_wrist(1), random_angles(1))
    np.testing.assert_allclose(np.linalg.norm(joints[:, 3:], axis=1), 1.0, atol=1e-12)


@pytest.mark.parametrize("side", SIDES)
def test_a_moved_wrist_carries_everything(side: Side):
    wrist, angles = random_wrist(2), random_angles(2)
    np.testing.assert_allclose(
        joints_of(side, wrist, angles), compose(wrist, joints_of(side, IDENTITY, angles)), atol=1e-12
    )


@pytest.mark.parametrize("side", SIDES)
def test_tips_are_turned_like_their_distal_bones(side: Side):
    joints = joints_of(side, random_wrist(3), random_angles(3))
    for finger in ("thumb", *FINGERS):
        np.testing.assert_array_equal(joints[INDEX[f"{finger}_tip"], 3:], joints[INDEX[f"{finger}_distal"], 3:])


@pytest.mark.parametrize("dof", ["THUMB_CMC_FE", "THUMB_CMC_AA"])
def test_both_carpal_angles_turn_the_thumb_metacarpal(dof: str):
    bent = np.zeros(20)
    bent[HAND.angle_names.index(dof)] = 0.3
    flat, turned = joints_of("right", IDENTITY, np.zeros(20)), joints_of("right", IDENTITY, bent)
    assert abs(flat[INDEX["thumb_metacarpal"], 3:] @ turned[INDEX["thumb_metacarpal"], 3:]) == pytest.approx(
        np.cos(0.15), abs=1e-6
    )


def test_thumb_mcp_turns_the_proximal_and_leaves_the_metacarpal():
    bent = np.zeros(20)
    bent[HAND.angle_names.index("THUMB_MCP_FE")] = 0.3
    flat, turned = joints_of("right", IDENTITY, np.zeros(20)), joints_of("right", IDENTITY, bent)
    same = np.all(np.isclose(flat, turned, atol=1e-12), axis=1)
    changed = {OPENXR_JOINT_NAMES[i] for i in np.flatnonzero(~same)}
    assert changed == {"thumb_proximal", "thumb_distal", "thumb_tip"}


@pytest.mark.parametrize("scale", [0.8, 1.2])
def test_palm_and_metacarpals_lie_in_the_palm_of_a_hand_of_any_size(scale: float):
    joints = joints_of("right", IDENTITY, random_angles(4), scale) / scale
    for finger in FINGERS:
        base, knuckle = joints[INDEX[f"{finger}_metacarpal"], :3], joints[INDEX[f"{finger}_proximal"], :3]
        assert 0.05 < np.linalg.norm(knuckle - base) < 0.09
    between = joints[[INDEX["middle_metacarpal"], INDEX["middle_proximal"]], :3].mean(axis=0)
    np.testing.assert_allclose(joints[INDEX["palm"], :3], between, atol=1e-12)
