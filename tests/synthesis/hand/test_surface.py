"""The hand's own skin: one closed surface per hand, that follows its bones, with its sensors on the palm side."""

import numpy as np
import pytest
import trimesh

from manipnet.geometry import mirror_points
from manipnet.synthesis.hand.bind_pose import BIND_ANGLES_RAD
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.hand.skeleton import DOF_JOINTS, DOF_LIMITS_RAD, DOF_NAMES
from manipnet.synthesis.hand.surface import (
    BONES,
    FACES,
    SENSOR_BONES,
    SENSOR_NORMALS,
    SENSOR_POINTS,
    SENSOR_WEIGHTS,
    VERTICES,
    WEIGHTS,
    skin,
)


@pytest.mark.parametrize("side", ["right", "left"])
def test_a_hand_is_one_watertight_surface_turned_outward(side: str) -> None:
    vertices, faces = (VERTICES, FACES) if side == "right" else (mirror_points(VERTICES), FACES[:, ::-1])
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert len(mesh.split(only_watertight=False)) == 1
    assert 2e-4 < mesh.volume < 6e-4  # a hand has a fifth to half a litre
    assert mesh.euler_number == 2


def test_weights_sum_to_one_and_stay_local() -> None:
    assert np.allclose(WEIGHTS.sum(axis=1), 1.0, atol=1e-6)
    assert np.allclose(SENSOR_WEIGHTS.sum(axis=1), 1.0, atol=1e-6)
    assert WEIGHTS.min() >= 0.0
    finger = {j: name.split("_")[0] for name, j in zip(DOF_NAMES, DOF_JOINTS.tolist(), strict=True)}
    counts = np.array(
        [
            len({finger[bone] for bone, w in zip(row, weights, strict=True) if w > 0.02 and bone in finger})
            for row, weights in zip(BONES.tolist(), WEIGHTS.tolist(), strict=True)
        ]
    )
    assert np.mean(counts <= 1) > 0.9, "most of the skin follows one finger or the palm"
    assert np.mean(counts <= 2) > 0.99, "at the webs it follows two neighbours"


def test_a_bent_finger_leaves_the_others_alone() -> None:
    bent = BIND_ANGLES_RAD.copy()
    for name in ("INDEX_MCP_FE", "INDEX_PIP_FE"):
        bent[DOF_NAMES.index(name)] += 0.8
    moved = np.linalg.norm(skin(*forward_kinematics(bent)) - skin(*forward_kinematics(BIND_ANGLES_RAD)), axis=1)
    mainly = BONES[np.arange(len(BONES)), WEIGHTS.argmax(axis=1)]
    assert moved[mainly >= 11].max() < 1e-3
    assert moved[mainly == 7].min() > 0.02


def test_the_bind_pose_gives_the_stored_vertices() -> None:
    assert np.allclose(skin(*forward_kinematics(BIND_ANGLES_RAD)), VERTICES, atol=1e-7)


@pytest.mark.parametrize("scale", [0.8, 1.15])
def test_the_skin_follows_a_hand_of_another_size(scale: float) -> None:
    angles = DOF_LIMITS_RAD @ [0.5, 0.5]
    positions, rotations = forward_kinematics(angles)
    usual, other = skin(positions, rotations), scale * skin(positions, rotations)
    size, joints = np.ptp(other, axis=0), scale * positions
    assert np.allclose(size, scale * np.ptp(usual, axis=0))
    mesh = trimesh.Trimesh(other, FACES, process=False)
    assert mesh.is_watertight
    assert np.linalg.norm(other - joints[[20]], axis=1).min() < 0.02 * scale, (
        "skin lies about the tip of the ring finger"
    )


def test_the_104_sensors_lie_on_the_palm_side() -> None:
    positions, rotations = forward_kinematics(BIND_ANGLES_RAD)
    frames = rotations[SENSOR_BONES]
    points = np.einsum("skij,skj->ski", frames, SENSOR_POINTS) + positions[SENSOR_BONES]
    points = np.sum(SENSOR_WEIGHTS[..., None] * points, axis=1)
    normals = np.sum(SENSOR_WEIGHTS[..., None] * np.einsum("skij,skj->ski", frames, SENSOR_NORMALS), axis=1)
    assert len(points) == 104
    apart = np.linalg.norm(points[:, None] - VERTICES, axis=2).min(axis=1)
    assert apart.max() < 1e-4, "they are points of the skin"
    spread = np.linalg.norm(points[:, None] - points + 1e3 * np.eye(104)[..., None], axis=2).min(axis=1)
    assert spread.min() > 0.004, "and apart from each other"
    fingers_and_palm = ~np.isin(SENSOR_BONES[:, 0], range(1, 5))
    assert np.mean(normals[fingers_and_palm, 2] < 0.0) > 0.97, "looking out of the palm, -z"
    assert set(np.unique(SENSOR_BONES[:, 0])) >= {0, 4, 7, 10, 13, 16}, "the palm and every last phalanx have some"
