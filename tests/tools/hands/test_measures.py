"""Contact carried onto hands of other proportions, measured on the demo's take."""

from dataclasses import dataclass

import numpy as np
import pytest
from avatar_profiles import scaled_profile

from manipnet.demo.player import DEMO_FILE
from manipnet.geometry import SIDES
from manipnet.synthesis.carrying import HandCarrier, Held
from manipnet.synthesis.hand.avatar import avatar_hand
from manipnet.synthesis.ik.carry import MAX_SHIFT_M
from manipnet.synthesis.model.bundle import load_bundle
from manipnet.synthesis.synthesizer import Synthesizer
from manipnet_tools.commands.synthesize import read_shapes
from manipnet_tools.hands.measures import carry_take, measure_hand
from manipnet_tools.takes.rollout import hand_inputs, held_objects, roll_out, tick_take
from manipnet_tools.takes.take import read_take


@dataclass(frozen=True)
class Grasp:
    """A synthesised hand and the object that it handles, at every tick."""

    angles: np.ndarray
    wrist: np.ndarray
    held: list[Held]


@pytest.fixture(scope="module")
def grasps():
    take = read_take(DEMO_FILE)
    shapes, ticks = read_shapes(("cube=cube", "cylinder=cylinder", "mug=mug"), take, DEMO_FILE), tick_take(take)
    inputs = hand_inputs(ticks, shapes)
    motions = roll_out(Synthesizer(load_bundle()), list(inputs.values()))
    return {
        side: Grasp(motion.angles, ticks.bodies[f"{side}_wrist"].poses, held_objects(ticks, shapes, inputs[side]))
        for side, motion in zip(inputs, motions, strict=True)
    }


MODEL = load_bundle().hand


def longest_stretch(grasp: Grasp) -> slice:
    """The longest stretch of ticks about one object."""
    names = [shape.name for shape, _, _ in grasp.held]
    edges = [0, *(n for n in range(1, len(names)) if names[n] != names[n - 1]), len(names)]
    first = max(range(len(edges) - 1), key=lambda n: edges[n + 1] - edges[n])
    return slice(edges[first], edges[first + 1])


@pytest.mark.parametrize(
    ("fingers", "whole", "least"),
    [(1.0, 1.0, 0.95), (0.85, 1.0, 0.95), (1.15, 1.0, 0.93), (1.0, 0.85, 0.93), (1.0, 1.15, 0.85)],
)
def test_pads_that_touch_go_on_touching(grasps, fingers, whole, least):
    profile, kept, touching = scaled_profile(MODEL, fingers, whole), [], []
    for side in SIDES:
        grasp = grasps[side]
        part = longest_stretch(grasp)
        held = grasp.held[part]
        shape, poses = held[0][0], np.array([pose for _, pose, _ in held])
        own, avatar = carry_take(MODEL, profile, side, grasp.angles[part], grasp.wrist[part], held)
        found = measure_hand(own, avatar, shape, poses)
        kept.append(found.kept * found.touching)
        touching.append(found.touching)
        assert found.penetration_cm[1] <= found.penetration_cm[0] + 0.02
        assert 0.7 <= found.smoothness <= 1.5
        assert found.shift_mm[1] <= 1000.0 * MAX_SHIFT_M + 1e-6
    assert sum(touching) > 100
    assert sum(kept) / sum(touching) >= least


@pytest.mark.parametrize("side", SIDES)
def test_bones_keep_their_lengths_and_angles_their_limits(grasps, side):
    profile, grasp = scaled_profile(MODEL, 1.15), grasps[side]
    avatar = avatar_hand(profile.hands[side], side, MODEL)
    carrier = HandCarrier(avatar, MODEL, side)
    rest = profile.hands[side].joints
    for angles, wrist, held in list(zip(grasp.angles, grasp.wrist, grasp.held, strict=True))[::7]:
        pose = carrier.step(angles, wrist, held)
        assert (pose.angles >= avatar.hand.limits[:, 0] - 1e-9).all()
        assert (pose.angles <= avatar.hand.limits[:, 1] + 1e-9).all()
        np.testing.assert_allclose(
            np.linalg.norm(np.diff(pose.joints[6:11, :3], axis=0), axis=1),
            np.linalg.norm(np.diff(rest[6:11, :3], axis=0), axis=1),
            atol=1e-6,
        )


@pytest.mark.parametrize("side", SIDES)
def test_a_free_hand_only_follows_the_model(grasps, side):
    shape, _, _ = grasps[side].held[0]
    avatar = avatar_hand(scaled_profile(MODEL, 1.15).hands[side], side, MODEL)
    carrier, angles = HandCarrier(avatar, MODEL, side), np.full(MODEL.angle_count, 0.2)
    here, far = np.array([0.0, 0, 0, 0, 0, 0, 1]), np.array([5.0, 0, 0, 0, 0, 0, 1])
    for _ in range(60):
        pose = carrier.step(angles, here, (shape, far, 1.0))
    np.testing.assert_allclose(pose.angles, avatar.follow @ angles, atol=1e-3)
    np.testing.assert_allclose(pose.wrist[:3], here[:3], atol=1e-4)


def test_the_left_hand_is_the_mirror_image_of_the_right(grasps):
    grasp = grasps["right"]
    profile = scaled_profile(MODEL, 1.1)
    mirror = np.array([-1.0, 1, 1, 1, -1, -1, 1])
    right = HandCarrier(avatar_hand(profile.hands["right"], "right", MODEL), MODEL, "right")
    left = HandCarrier(avatar_hand(profile.hands["left"], "left", MODEL), MODEL, "left")
    sphere_like = next(held for held in grasp.held)
    for angles, wrist in list(zip(grasp.angles, grasp.wrist, strict=True))[:30]:
        far = (sphere_like[0], np.array([9.0, 0, 0, 0, 0, 0, 1]), 1.0)
        a, b = right.step(angles, wrist, far), left.step(angles, wrist * mirror, (far[0], far[1] * mirror, 1.0))
        np.testing.assert_allclose(b.joints[:, :3], a.joints[:, :3] * mirror[:3], atol=1e-6)


def test_contact_fades_when_the_object_is_lost_and_a_held_hand_stays(grasps):
    grasp, side = grasps["right"], "right"
    avatar = avatar_hand(scaled_profile(MODEL, 1.15).hands[side], side, MODEL)
    carrier = HandCarrier(avatar, MODEL, side)
    middle = len(grasp.held) // 2
    for n in range(middle - 60, middle):
        pose = carrier.step(grasp.angles[n], grasp.wrist[n], grasp.held[n])
    held = carrier.hold(grasp.angles[middle], grasp.wrist[middle - 1])
    np.testing.assert_array_equal(held.angles, pose.angles)
    for _ in range(240):
        pose = carrier.step(grasp.angles[middle], grasp.wrist[middle], None)
    np.testing.assert_allclose(pose.angles, avatar.follow @ grasp.angles[middle], atol=1e-2)
