"""A hand as a value: its file, what makes it usable, and hands with fewer fingers through the whole synthesis."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from compiled import call
from other_hands import three_fingered, with_joints
from tiny_bundle import tiny_network
from written_scene import scenes_at

from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.hand_file import HAND_FILE, read_hand, write_hand
from manipnet.synthesis.hand.kinematics import angles_from_rotations, forward_kinematics
from manipnet.synthesis.hand.packed import unpack_chains, unpack_sensors, unpack_skeleton
from manipnet.synthesis.hand.validation import HandError
from manipnet.synthesis.ik.solvers import SOLVERS
from manipnet.synthesis.model.bundle import Bundle, open_session
from manipnet.synthesis.model.layout import layout_of
from manipnet.synthesis.model.shipped import shipped_bundles, shipped_hand
from manipnet.synthesis.objects.mesh import closed_mesh
from manipnet.synthesis.objects.shape import build_shape
from manipnet.synthesis.synthesizer import Synthesizer

HAND = shipped_hand()
THREE = three_fingered(HAND)
SHORT = with_joints(HAND, [j for j in range(22) if j not in (7, 18)], "an index finger of two bones")


def arrays_of(hand: Hand) -> dict[str, np.ndarray]:
    """Every array of a hand, by name."""
    tuples = {"skeleton": hand.skeleton, "chains": hand.chains, "skin": hand.skin, "sensors": hand.sensors}
    return {f"{name}.{field}": value for name, values in tuples.items() for field, value in values._asdict().items()}


def test_every_shipped_bundle_has_the_hand_of_its_data() -> None:
    hands = {name: (folder / HAND_FILE).read_bytes() for name, folder in shipped_bundles().items()}
    assert len(hands) == 5
    free = hands.pop("manipnet-open")
    assert len(set(hands.values())) == 1
    assert free not in hands.values()


def test_the_layout_of_the_shipped_hand_is_that_of_the_paper() -> None:
    layout = layout_of(HAND)
    assert (layout.input_size, layout.output_size) == (2356, 220)
    assert layout.describe()["input"][7:] == [
        ["ambient", [10, 10, 10]],
        ["proximity", [6, 104]],
        ["signed_distances", [6, 22]],
        ["surface_normals", [22, 3]],
    ]


@pytest.mark.parametrize("hand", [HAND, THREE, SHORT], ids=lambda hand: hand.name)
def test_a_hand_is_read_as_it_was_written(hand: Hand, tmp_path: Path) -> None:
    write_hand(hand, tmp_path / "hand.npz")
    again = read_hand(tmp_path / "hand.npz")
    assert (again.name, again.joint_names, again.angle_names) == (hand.name, hand.joint_names, hand.angle_names)
    assert again.fingers == hand.fingers
    for name, value in arrays_of(hand).items():
        np.testing.assert_array_equal(arrays_of(again)[name], value, err_msg=name)


@pytest.mark.parametrize("hand", [HAND, THREE, SHORT], ids=lambda hand: hand.name)
def test_compiled_code_unpacks_what_was_packed(hand: Hand) -> None:
    for unpack, expected in (
        (unpack_skeleton, hand.skeleton),
        (unpack_chains, hand.chains),
        (unpack_sensors, hand.sensors),
    ):
        for ours, theirs in zip(call(unpack, hand.packed), expected, strict=True):
            np.testing.assert_array_equal(ours, theirs)


def test_a_hand_that_was_read_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        HAND.offsets[1, 0] = 0.5


@pytest.mark.parametrize(
    ("changed", "complaint"),
    [
        ({"axes": 2.0 * HAND.axes}, "axes must have length 1"),
        ({"offsets": np.full_like(HAND.offsets, np.nan)}, "offsets_m holds a number that is not finite"),
        ({"limits": HAND.limits[:, ::-1]}, r"limits_rad of PINKY_MCP_FE are .*; the lower must come first"),
        ({"limits": HAND.limits[:19]}, r"limits_rad has the shape \(19, 2\); expected is \(A 2\) with A = 20"),
        ({"parents": np.roll(HAND.parents, 1)}, "parents must be -1 for joint 0"),
        ({"angle_bones": HAND.angle_bones[::-1]}, "angle_bones must rise"),
        ({"capsules": HAND.capsules + 17}, "capsules holds 17 … 38; allowed are 0 … 21"),
        ({"radii": -HAND.radii}, "radii_m must be above 0"),
        ({"fingers": ((1, 2, 3, 4, 17), (5, 6, 7, 18))}, "every bone that an angle turns must belong to one"),
        ({"fingers": ((1, 3, 17), *HAND.fingers[1:])}, r"fingers\[0\] is \(1, 3, 17\); a finger is 2 to 5 joints"),
        ({"joint_names": HAND.joint_names[:-1]}, "21 joint names for 22 joints"),
        ({"joint_names": ("WRIST",) * 22}, "joint_names must be a list of distinct names"),
        ({"skin": HAND.skin._replace(weights=0.5 * HAND.skin.weights)}, "skin_weights must be at least 0 and sum to 1"),
    ],
)
def test_a_hand_that_cannot_be_used_is_refused(changed: dict, complaint: str, tmp_path: Path) -> None:
    with pytest.raises(HandError, match=complaint):
        write_hand(replace(HAND, **changed), tmp_path / "hand.npz")


@pytest.mark.parametrize("content", [b"", b"not a zip", b"PK\x03\x04", None])
def test_a_damaged_file_is_refused(content: bytes | None, tmp_path: Path) -> None:
    path = tmp_path / "hand.npz"
    if content is None:
        np.savez(path, format=1, name="nothing else")
    else:
        path.write_bytes(content)
    with pytest.raises(HandError, match=r"hand\.npz: "):
        read_hand(path)


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(HandError, match="cannot be read"):
        read_hand(tmp_path / "gone.npz")


def test_three_fingers_move_as_they_do_among_five() -> None:
    kept = [HAND.angle_names.index(name) for name in THREE.angle_names]
    angles = HAND.limits @ [0.3, 0.7]
    positions, rotations = forward_kinematics(HAND, angles)
    fewer, turned = forward_kinematics(THREE, angles[kept])
    np.testing.assert_allclose(fewer, positions[[HAND.joint_names.index(name) for name in THREE.joint_names]])
    np.testing.assert_allclose(turned, rotations[: THREE.bone_count])
    np.testing.assert_allclose(angles_from_rotations(THREE, turned), angles[kept], atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("hand", [THREE, SHORT], ids=lambda hand: hand.name)
def test_a_hand_of_fewer_bones_goes_through_the_whole_synthesis(hand: Hand, solver: str, tmp_path: Path) -> None:
    layout = layout_of(hand)
    session = open_session("tiny", tiny_network(hand), layout)
    bundle = Bundle("tiny", hand, layout, hand.limits @ [0.7, 0.3], hand.limits, 0.5, {}, "", session, tmp_path)
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.05)
    shape = build_shape(closed_mesh(ball.vertices, ball.faces, "ball"), tmp_path)
    synthesizer = Synthesizer(bundle, solver)
    states = [synthesizer.rest_state()] * 3
    for tick in range(4):
        steps = synthesizer.step(scenes_at(tick, [shape, shape]), states)
        states = [step.state for step in steps]
        for step in steps:
            assert step.positions.shape == (hand.joint_count, 3)
            assert np.all(hand.limits[:, 0] <= step.angles)
            assert np.all(step.angles <= hand.limits[:, 1])
            np.testing.assert_allclose(step.positions, forward_kinematics(hand, step.angles)[0], atol=1e-12)
    moved = max(np.abs(step.positions - step.raw_positions).max() for step in steps)
    assert (moved > 1e-4) == (solver != "none")
