"""The shipped hands: profiles that can be used, skins that follow their joints, names in place of files."""

from pathlib import Path

import numpy as np
import pytest

from manipnet.config.rig_reader import parse_rig
from manipnet.config.rig_writer import rig_text
from manipnet.config.settings import ServerConfig
from manipnet.geometry import SIDES, compose, quat_rotate
from manipnet.synthesis.hand import shipped
from manipnet.synthesis.hand.avatar import avatar_hand
from manipnet.synthesis.hand.profile import FINGERS, ProfileError, read_profile
from manipnet.synthesis.hand.shipped_files import FOLDER, hand_file, hand_name
from manipnet.synthesis.model.shipped import shipped_hand

pytestmark = pytest.mark.quick


@pytest.mark.parametrize("name", shipped.names())
def test_every_shipped_hand_has_five_whole_fingers_of_human_size(name):
    profile = shipped.load(name)
    assert profile.name == name
    for side in SIDES:
        hand = profile.hands[side]
        assert not np.isnan(hand.joints).any()
        assert 0.12 < -hand.joints[:, 2].min() < 0.2
        assert len(avatar_hand(hand, side, shipped_hand()).hand.fingers) == len(FINGERS)


def test_the_shipped_hands_differ_in_their_proportions():
    palms, fingers = [], []
    for name in shipped.names():
        joints = shipped.load(name).hands["right"].joints
        palms.append(np.linalg.norm(joints[12, :3]))
        fingers.append(np.linalg.norm(joints[15, :3] - joints[12, :3]))
    assert max(palms) > 1.1 * min(palms)
    ratios = np.array(fingers) / palms
    assert ratios.max() > 1.1 * ratios.min()


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("name", shipped.names())
def test_the_skin_encloses_the_fingertips_of_its_profile(name, side):
    skin, hand = shipped.mesh(name, side), shipped.load(name).hands[side]
    vertices = skin.posed(hand.joints)
    np.testing.assert_allclose(skin.weights.sum(axis=1), 1.0)
    np.testing.assert_allclose(skin.posed(skin.bind), skin.vertices, atol=1e-6)
    for row in FINGERS:
        pad = hand.joints[row[-1], :3] + quat_rotate(hand.joints[row[-1], 3:], np.array([0, -hand.radii[row[-1]], 0]))
        assert np.linalg.norm(vertices - pad, axis=1).min() < 0.005
    tip = hand.joints[FINGERS[2][-1]]
    assert vertices[:, 2].min() == pytest.approx(tip[2] - hand.radii[FINGERS[2][-1]], abs=0.006)
    assert skin.opacity[vertices[:, 2] < -0.01].min() == 1.0
    a, b, c = (skin.vertices[skin.faces[:, k]] for k in range(3))
    centre = skin.vertices.mean(axis=0)
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), (a + b + c) / 3 - centre)
    assert outward.sum() > 0.0


def test_a_skin_follows_a_hand_anywhere():
    skin, move = shipped.mesh("adult"), np.array([0.3, 1.2, -0.4, 0.5, 0.5, 0.5, 0.5])
    moved = skin.posed(compose(move, skin.bind))
    np.testing.assert_allclose(moved, quat_rotate(move[3:], skin.vertices) + move[:3], atol=1e-6)


def test_a_name_stands_for_the_file_of_a_shipped_hand_unless_there_is_such_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert hand_file("adult") == FOLDER / "adult.json"
    assert hand_name(hand_file("adult")) == "adult"
    assert read_profile(Path("child")).name == "child"
    assert hand_name(hand_file("mine.json")) is None
    (tmp_path / "adult").write_text("{}")
    assert hand_file("adult") == Path("adult")


def test_a_rig_file_takes_the_name_of_a_shipped_hand_and_keeps_it(tmp_path):
    rig = parse_rig("hand = 'adult'\n[bodies]\nleft_wrist = 'l'\nright_wrist = 'r'\n", tmp_path, "rig.toml")
    assert rig.actors[0].hand == FOLDER / "adult.json"
    assert 'hand = "adult"' in rig_text(ServerConfig(actors=rig.actors))


def test_an_unknown_name_is_refused_with_those_that_are_shipped():
    with pytest.raises(ProfileError, match="generic, adult, child"):
        shipped.load("giant")
    with pytest.raises(ProfileError, match="generic, adult, child"):
        shipped.mesh("giant")
