"""Exports on the hand of an avatar."""

import numpy as np
import pytest
from avatar_profiles import scaled_profile

from manipnet.demo.player import DEMO_FILE
from manipnet.geometry import SIDES
from manipnet.synthesis.hand.profile import profile_to_json
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet_tools.cli import main
from manipnet_tools.export.animation import read_animation
from manipnet_tools.export.avatar_tracks import capsule_skin, carry_animation

MODEL = shipped_hand()


@pytest.fixture(scope="module")
def fingers(tmp_path_factory):
    out = tmp_path_factory.mktemp("fingers") / "demo.npz"
    meshes = [f"--mesh={name}={name}" for name in ("cube", "cylinder", "mug")]
    assert main(["synthesize", str(DEMO_FILE), *meshes, "--out", str(out)]) == 0
    return out


def test_bones_have_the_lengths_of_the_avatar(fingers):
    profile = scaled_profile(MODEL, 0.9, 1.05)
    carried = carry_animation(read_animation(fingers, MODEL), profile)
    for side in SIDES:
        track = carried.hands[side]
        rest = profile.hands[side].joints
        positions, _ = track.world()
        assert track.model.joint_names[4:7] == ("index_proximal", "index_intermediate", "index_distal")
        lengths = np.linalg.norm(np.diff(positions[:, 4:7], axis=1), axis=-1)
        np.testing.assert_allclose(
            lengths, np.tile(np.linalg.norm(np.diff(rest[7:10, :3], axis=0), axis=1), (len(lengths), 1)), atol=1e-5
        )


def test_a_skin_of_capsules_is_closed_and_follows_the_bones():
    import trimesh

    carried = capsule_skin(MODEL)
    assert trimesh.Trimesh(carried.vertices, carried.faces, process=False).is_watertight
    assert carried.bones.max() < MODEL.bone_count
    np.testing.assert_array_equal(carried.weights.sum(axis=1), 1.0)


@pytest.mark.parametrize(("format_", "name"), [("gltf", "hands.glb"), ("bvh", "hands"), ("csv", "hands.csv")])
def test_the_command_writes_every_format(fingers, tmp_path, format_, name):
    hand = tmp_path / "hand.json"
    hand.write_text(profile_to_json(scaled_profile(MODEL, 1.1)), encoding="utf-8")
    out = tmp_path / name
    assert main(["export", str(fingers), "--format", format_, "--hand", str(hand), "--out", str(out)]) == 0
    text = (out / "leftHand.bvh" if format_ == "bvh" else out).read_bytes()
    assert b"index_intermediate" in text
