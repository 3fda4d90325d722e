"""The finger bones of any rig point where the synthesised ones do, in Python (right-handed) and C# (Unity's axes)."""

import numpy as np
import pytest
from languages import run
from manipnet_client import decode
from manipnet_client.retarget import BONES, FINGERS, PARTS, HandRig, is_hand, is_thumb_metacarpal, matches
from random_hand import HAND, posed

from manipnet.geometry import quat_conjugate, quat_exp, quat_multiply, quat_rotate
from manipnet.outputs.axes import to_unity
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.wire import encode_binary


def foreign_rig(side, rng, mirrored):
    """A slightly bent bind pose with other proportions and random rotations of the hand bone and the bone axes.

    Returns positions, rotations and tips in the space of the hand bone, and the rotation from our wrist frame to it.
    """
    positions, _ = forward_kinematics(HAND, rng.uniform(-0.2, 0.3, 20))
    positions = 1.3 * positions
    positions[[5, 8, 14]] = (
        1.3 * forward_kinematics(HAND, np.zeros(20))[0][[5, 8, 14]]
    )  # the knuckles define the hand's orientation
    if (side == "left") != mirrored:
        positions = positions * [-1, 1, 1]
    turn = quat_exp(rng.normal(size=3))
    positions = quat_rotate(turn, positions)
    rotations = np.array([quat_exp(x) for x in rng.normal(size=(15, 3))])
    return positions[BONES], rotations, positions[17:], turn


def shown_directions(positions, rotations, tips, posed_rotations):
    """Unit directions of the rig's posed bones `(15, 3)`: the bind directions, rotated from bind pose to posed."""
    ends = np.array([tips[i // 3] if i % 3 == 2 else positions[i + 1] for i in range(15)])
    bind = ends - positions
    turned = quat_rotate(quat_multiply(posed_rotations, quat_conjugate(rotations)), bind)
    return turned / np.linalg.norm(turned, axis=1, keepdims=True)


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("seed", range(3))
def test_python_rig_points_where_the_hand_does(side, seed):
    rng = np.random.default_rng(seed)
    message, along = posed(side, rng)
    positions, rotations, tips, turn = foreign_rig(side, rng, mirrored=False)
    hand = decode(encode_binary(message)).hand(side)
    assert hand is not None
    rig = HandRig(side, positions, rotations, tips)
    shown = shown_directions(positions, rotations, tips, rig.solve(hand))
    np.testing.assert_allclose(shown, quat_rotate(turn, along), atol=1e-5)
    wrist = quat_multiply(rig.hand_rotation(hand), turn)
    assert abs(wrist @ hand.wrist[3:]) == pytest.approx(1.0, abs=1e-6)


def test_csharp_rig_points_where_the_hand_does(harness):
    command = harness("csharp")
    rng, lines, checks = np.random.default_rng(1), [], []
    for side in ("left", "right"):
        message, along = posed(side, rng)
        positions, rotations, tips, turn = foreign_rig(side, rng, mirrored=True)
        numbers = np.hstack([positions, rotations]).ravel().tolist() + tips.ravel().tolist()
        lines += [" ".join(map(str, [int(side == "right"), *numbers])), encode_binary(message).hex()]
        checks.append((message.hands[side], along * [-1, 1, 1], positions, rotations, tips, turn))
    for line, (hand, along, positions, rotations, tips, turn) in zip(
        run(command, "retarget", text="\n".join(lines) + "\n"), checks, strict=True
    ):
        out = np.array([float(x) for x in line.split()]).reshape(16, 4)
        shown = shown_directions(positions, rotations, tips, out[:15])
        np.testing.assert_allclose(shown, quat_rotate(turn, along), atol=1e-4)
        assert abs(quat_multiply(out[15], turn) @ to_unity(hand.wrist)[3:]) == pytest.approx(1.0, abs=1e-5)


BONE_NAMES = {
    "LeftIndexProximal": ("left", 1, 0),
    "RightThumbDistal": ("right", 0, 2),
    "mixamorig:LeftHandPinky3": ("left", 4, 2),
    "RightHandThumb1": ("right", 0, 0),
    "index_02_r": ("right", 1, 1),
    "pinky_01_l": ("left", 4, 0),
    "f_ring.03.L": ("left", 3, 2),
    "thumb.01.R": ("right", 0, 0),
    "J_Bip_R_Little2": ("right", 4, 1),
    "LeftHand": ("left", None, None),
    "mixamorig:RightHand": ("right", None, None),
    "hand_l": ("left", None, None),
    "hand.R": ("right", None, None),
    "mixamorig_RightHandRing2": ("right", 3, 1),
    "mixamorigLeftHand": ("left", None, None),
    "DEF-f_middle.02.L": ("left", 2, 1),
    "DEF-thumb.03.R": ("right", 0, 2),
    "DEF-hand.R": ("right", None, None),
    "LeftThumbMetacarpal": ("left", 0, 0),
    "index2.r": ("right", 1, 1),
    "thumb1.l": ("left", 0, 0),
    "c_pinky3.l": ("left", 4, 2),
    "c_hand_fk.r": ("right", None, None),
    "CC_Base_L_Mid1": ("left", 2, 0),
    "CC_Base_R_Hand": ("right", None, None),
    "lMid2": ("left", 2, 1),
    "r_ring3": ("right", 3, 2),
    "rHand": ("right", None, None),
    "Bip01 L Finger0": ("left", 0, 0),
    "Bip01 R Finger42": ("right", 4, 2),
    "Bip01 L Hand": ("left", None, None),
    "left_pinky3": ("left", 4, 2),
    "right_wrist": ("right", None, None),
    "finger2-1.R": ("right", 1, 0),
    "wrist.L": ("left", None, None),
    "Thumb0_L": ("left", 0, 0),
    "Thumb2_R": ("right", 0, 2),
    "LittleFinger3_R": ("right", 4, 2),
    "Left wrist": ("left", None, None),
    "Thumb Intermediate.R": ("right", 0, 1),
    "Ring Distal.L": ("left", 3, 2),
    "LeftForeArm": None,
    "ring": None,
    "Bip01 L Finger5": None,
    "index_metacarpal_l": None,
}


def test_bone_names_in_python():
    for name, meaning in BONE_NAMES.items():
        found = [(s, None, None) for s in ("left", "right") if is_hand(name, s)]
        found += [
            (s, f, p)
            for s in ("left", "right")
            for f in range(len(FINGERS))
            for p in range(len(PARTS))
            if matches(name, s, f, p)
        ]
        assert found == ([meaning] if meaning else []), name


def test_a_thumb_with_a_metacarpal_bone_is_counted_from_there():
    bones = ["LeftThumbMetacarpal", "LeftThumbProximal", "LeftThumbDistal"]
    assert any(is_thumb_metacarpal(bone, "left") for bone in bones)
    for part in range(3):
        assert [bone for bone in bones if matches(bone, "left", 0, part, thumb_metacarpal=True)] == [bones[part]]


def test_bone_names_in_csharp(harness):
    lines = run(harness("csharp"), "names", text="".join(f"{name}\n" for name in BONE_NAMES))
    for line, (name, meaning) in zip(lines, BONE_NAMES.items(), strict=True):
        if meaning is None:
            assert line == "none", name
        else:
            side, finger, part = meaning
            expected = f"{side.capitalize()} " + ("hand" if finger is None else f"{finger} {part}")
            assert line == expected, name
