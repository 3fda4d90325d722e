"""The skin of the shipped hand: one closed surface that follows its bones, with sensors on the palm side."""

import numpy as np
import pytest
import trimesh

from manipnet.geometry import mirror_points
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.hand.skin import skinned
from manipnet.synthesis.model.shipped import shipped_hand

HAND = shipped_hand()


@pytest.mark.parametrize("side", ["right", "left"])
def test_a_hand_is_one_watertight_surface_turned_outward(side: str) -> None:
    vertices, faces = (
        (HAND.skin.vertices, HAND.skin.faces)
        if side == "right"
        else (mirror_points(HAND.skin.vertices), HAND.skin.faces[:, ::-1])
    )
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert len(mesh.split(only_watertight=False)) == 1
    assert 2e-4 < mesh.volume < 6e-4  # a hand has a fifth to half a litre
    assert mesh.euler_number == 2


def test_weights_sum_to_one_and_stay_local() -> None:
    assert np.allclose(HAND.skin.weights.sum(axis=1), 1.0, atol=1e-6)
    assert np.allclose(HAND.sensors.weights.sum(axis=1), 1.0, atol=1e-6)
    assert HAND.skin.weights.min() >= 0.0
    finger = {j: name.split("_")[0] for name, j in zip(HAND.angle_names, HAND.angle_bones.tolist(), strict=True)}
    counts = np.array(
        [
            len({finger[bone] for bone, w in zip(row, weights, strict=True) if w > 0.02 and bone in finger})
            for row, weights in zip(HAND.skin.bones.tolist(), HAND.skin.weights.tolist(), strict=True)
        ]
    )
    assert np.mean(counts <= 1) > 0.9, "most of the skin follows one finger or the palm"
    assert np.mean(counts <= 2) > 0.99, "at the webs it follows two neighbours"


def test_a_bent_finger_leaves_the_others_alone() -> None:
    bent = HAND.skin.bind_angles.copy()
    for name in ("INDEX_MCP_FE", "INDEX_PIP_FE"):
        bent[HAND.angle_names.index(name)] += 0.8
    bent_skin = skinned(HAND, *forward_kinematics(HAND, bent))
    moved = np.linalg.norm(bent_skin - skinned(HAND, *forward_kinematics(HAND, HAND.skin.bind_angles)), axis=1)
    mainly = HAND.skin.bones[np.arange(len(HAND.skin.bones)), HAND.skin.weights.argmax(axis=1)]
    assert moved[mainly >= 11].max() < 1e-3
    assert moved[mainly == 7].min() > 0.02


def test_the_bind_pose_gives_the_stored_vertices() -> None:
    assert np.allclose(skinned(HAND, *forward_kinematics(HAND, HAND.skin.bind_angles)), HAND.skin.vertices, atol=1e-7)


@pytest.mark.parametrize("scale", [0.8, 1.15])
def test_the_skin_follows_a_hand_of_another_size(scale: float) -> None:
    angles = HAND.limits @ [0.5, 0.5]
    positions, rotations = forward_kinematics(HAND, angles)
    usual, other = skinned(HAND, positions, rotations), scale * skinned(HAND, positions, rotations)
    size, joints = np.ptp(other, axis=0), scale * positions
    assert np.allclose(size, scale * np.ptp(usual, axis=0))
    mesh = trimesh.Trimesh(other, HAND.skin.faces, process=False)
    assert mesh.is_watertight
    assert np.linalg.norm(other - joints[[20]], axis=1).min() < 0.02 * scale, (
        "skin lies about the tip of the ring finger"
    )


def test_the_104_sensors_lie_on_the_palm_side() -> None:
    positions, rotations = forward_kinematics(HAND, HAND.skin.bind_angles)
    frames = rotations[HAND.sensors.bones]
    points = np.einsum("skij,skj->ski", frames, HAND.sensors.points) + positions[HAND.sensors.bones]
    points = np.sum(HAND.sensors.weights[..., None] * points, axis=1)
    normals = np.sum(HAND.sensors.weights[..., None] * np.einsum("skij,skj->ski", frames, HAND.sensors.normals), axis=1)
    assert len(points) == 104
    apart = np.linalg.norm(points[:, None] - HAND.skin.vertices, axis=2).min(axis=1)
    assert apart.max() < 1e-4, "they are points of the skin"
    spread = np.linalg.norm(points[:, None] - points + 1e3 * np.eye(104)[..., None], axis=2).min(axis=1)
    assert spread.min() > 0.004, "and apart from each other"
    fingers_and_palm = ~np.isin(HAND.sensors.bones[:, 0], range(1, 5))
    assert np.mean(normals[fingers_and_palm, 2] < 0.0) > 0.97, "looking out of the palm, -z"
    assert set(np.unique(HAND.sensors.bones[:, 0])) >= {0, 4, 7, 10, 13, 16}, "on the palm and every last phalanx"
