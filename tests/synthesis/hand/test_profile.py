"""Hand profiles: what is read, what is refused and why."""

import copy
import json

import numpy as np
import pytest
from avatar_profiles import as_content, scaled_profile

from manipnet.synthesis.hand.profile import FINGERS, ProfileError, parse_profile, profile_to_json, read_profile
from manipnet.synthesis.model.shipped import shipped_hand

GOOD = as_content(scaled_profile(shipped_hand()))


def changed(change) -> dict:
    content = copy.deepcopy(GOOD)
    change(content)
    return content


def test_what_is_written_is_read_again(tmp_path):
    profile = parse_profile(GOOD)
    file = tmp_path / "hand.json"
    file.write_text(profile_to_json(profile), encoding="utf-8")
    again = read_profile(file)
    for side in ("left", "right"):
        np.testing.assert_allclose(again.hands[side].joints, profile.hands[side].joints, atol=1e-6)
        np.testing.assert_allclose(again.hands[side].radii, profile.hands[side].radii, atol=1e-6)


def test_a_missing_hand_is_the_mirror_image_of_the_other():
    whole, half = parse_profile(GOOD), parse_profile({"name": "half", "right": GOOD["right"]})
    np.testing.assert_allclose(half.hands["left"].joints[:, :3], whole.hands["left"].joints[:, :3], atol=1e-9)


def test_joints_are_taken_relative_to_the_wrist():
    moved = changed(lambda c: [row.__setitem__(1, row[1] + 0.5) for row in c["right"]["joints"]])
    np.testing.assert_allclose(
        parse_profile(moved).hands["right"].joints, parse_profile(GOOD).hands["right"].joints, atol=1e-9
    )


def test_missing_joints_and_radii_are_not_numbers():
    def cut(content):
        for k in FINGERS[4]:
            content["right"]["joints"][k] = None
        content["right"].pop("radii")

    hand = parse_profile(changed(cut)).hands["right"]
    assert np.isnan(hand.joints[list(FINGERS[4])]).all()
    assert np.isnan(hand.radii).all()


def scale(factor):
    def change(content):
        for row in content["right"]["joints"]:
            row[:3] = [factor * x for x in row[:3]]

    return change


def mirror(content):
    for row in content["left"]["joints"]:
        row[0] = -row[0]


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ([], "is a map"),
        ({"name": "x"}, "neither a left nor a right hand"),
        ({"left": GOOD["left"]}, "name must be a text"),
        (changed(lambda c: c.update(name="")), "name must be a text"),
        (changed(lambda c: c.update(name="my avatar")), "spaces"),
        (changed(lambda c: c.update(name="a/b")), "slashes"),
        (changed(lambda c: c.update(name="x" * 64)), "63 bytes"),
        (changed(lambda c: c.update(middle={})), "has no 'middle'"),
        (changed(lambda c: c.update(left=[])), "left: must be a map"),
        (changed(lambda c: c["left"].pop("joints")), "left: must be a map"),
        (changed(lambda c: c["left"]["joints"].pop()), "a list of 25"),
        (changed(lambda c: c["left"]["joints"][3].pop()), r"joint 3 \(thumb_proximal\) must be 7 numbers"),
        (changed(lambda c: c["left"]["joints"][3].__setitem__(0, "a")), "7 numbers"),
        (changed(lambda c: c["left"]["joints"][3].__setitem__(0, True)), "7 numbers"),
        (changed(lambda c: c["left"]["joints"][3].__setitem__(0, float("nan"))), "not finite"),
        (changed(lambda c: c["left"]["joints"][3].__setitem__(0, 10**400)), "not finite"),
        (changed(lambda c: c["left"]["joints"][3].__setitem__(6, 3.0)), "quaternion of length"),
        (changed(lambda c: c["left"]["joints"].__setitem__(1, None)), "the wrist"),
        (changed(lambda c: c["left"]["radii"].pop()), "radii must be a list of 26"),
        (changed(lambda c: c["left"]["radii"].__setitem__(5, -1.0)), r"radius 5 \(thumb_tip\)"),
        (changed(lambda c: c["left"]["radii"].__setitem__(5, float("nan"))), "radius 5"),
        (changed(lambda c: c["left"]["radii"].__setitem__(5, 10**400)), "radius 5"),
        (changed(lambda c: c.update(left=c["right"])), "this is a right hand"),
        (changed(mirror), "mirrored"),
        (changed(scale(0.01)), "multiply its positions by 100"),
        (changed(scale(100.0)), "centimetres.*multiply its positions by 0.01"),
        (changed(scale(1000.0)), "millimetres"),
        (changed(scale(30.0)), "allowed are"),
        (changed(lambda c: c["right"].update(joints=[[0, 0, 0, 0, 0, 0, 1]] * 26)), "no finger"),
    ],
)
def test_a_wrong_profile_is_refused_with_the_reason(content, reason):
    with pytest.raises(ProfileError, match=reason):
        parse_profile(content)


def test_a_file_that_is_not_json_is_named(tmp_path):
    file = tmp_path / "hand.json"
    file.write_text("{", encoding="utf-8")
    with pytest.raises(ProfileError, match=r"hand\.json: is not a JSON file"):
        read_profile(file)
    file.write_text(json.dumps({"name": "x"}), encoding="utf-8")
    with pytest.raises(ProfileError, match=r"hand\.json: x: has neither"):
        read_profile(file)
    with pytest.raises(ProfileError, match="cannot be read"):
        read_profile(tmp_path / "absent.json")
