"""Objects that are too wide for one hand are held by two, and neither hand alone holds them."""

from collections import Counter

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="needs the extra generate")
pytest.importorskip("manifold3d", reason="needs the extra generate")
import mujoco

from manipnet.geometry import mirror_points
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.objects.shape import build_shape
from manipnet_tools.generate.bank import fill_bank
from manipnet_tools.generate.finger_tables import tables_of
from manipnet_tools.generate.forces import carried, cone_columns
from manipnet_tools.generate.free_hand import free_hand
from manipnet_tools.generate.proportions import Proportions, proportioned
from manipnet_tools.generate.proposals import Pinches, kinds_for
from manipnet_tools.generate.scenes import Director
from manipnet_tools.generate.shapes import make_shape
from manipnet_tools.generate.simulate import hand_model
from manipnet_tools.generate.two_hands import DOWNS, mirrored_hand

pytestmark = pytest.mark.slow
NO_PINCHES = Pinches(np.empty((0, 3, 3)), np.empty((0, 3)), np.empty(0))


@pytest.fixture(scope="module")
def crate():
    return next(made for made in (make_shape(number, seed=1) for number in range(200)) if made.kind == "crate")


@pytest.fixture(scope="module")
def bank(crate, tmp_path_factory):
    shape = build_shape(crate.mesh, tmp_path_factory.mktemp("cache"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("manipnet_tools.generate.bank.WANTED", 4)  # fewer are found sooner
        return fill_bank(tables_of(free_hand()), (NO_PINCHES, NO_PINCHES), crate, shape, np.random.default_rng(0))


def test_wide_objects_are_for_two_hands():
    assert kinds_for((), 0.15) == ("press",)
    assert "press" not in kinds_for((), 0.1)


def test_each_hand_of_a_pair_presses_against_the_other(bank):
    pairs: dict[int, dict[str, np.ndarray]] = {}
    for held in bank.grasps:
        assert held.kind == "press"
        pairs.setdefault(held.pair, {})[held.side] = held.back
    assert len(pairs) >= 2
    for hands in pairs.values():
        assert set(hands) == {"left", "right"}
        assert hands["left"] @ hands["right"] < 0.0, "they come from opposite sides"


def test_one_flat_hand_against_a_side_carries_nothing():
    points, normals = (
        np.array([[0.1, y, z] for y in (-0.03, 0.03) for z in (-0.03, 0.03)]),
        np.tile([1.0, 0, 0], (4, 1)),
    )
    both = np.concatenate([points, mirror_points(points)]), np.concatenate([normals, -normals])
    assert not carried(cone_columns(points, normals, np.zeros(3)), DOWNS).any()
    assert carried(cone_columns(*both, np.zeros(3)), DOWNS).all()


def test_hands_of_a_pair_come_and_go_together(bank, crate):
    director = Director(bank.grasps, crate.mesh.vertices, np.random.default_rng(1))
    scene = director.direct(20.0)
    held = [event for event in director.events if event["event"] != "near"]
    assert Counter(event["event"] for event in held) == {"together": len(held)}
    assert len(held) >= 2
    for first, second in zip(held[::2], held[1::2], strict=True):
        assert {first["side"], second["side"]} == {"left", "right"}
        assert (first["start_s"], first["end_s"]) == (second["start_s"], second["end_s"])
    lifts = [move for move in scene.moves if any(h.contact_s < move.start_s < h.release_s for h in scene.holds)]
    assert len(lifts) == len(scene.moves), "the object moves only while both hands hold it"


def test_the_simulator_has_the_mirror_image_of_a_left_hand():
    hand = proportioned(free_hand(), Proportions(1.1, 0.95, 1.1, (0.003, -0.008), -0.2), "leaning")
    model = hand_model(mirrored_hand(hand))
    data = mujoco.MjData(model)
    data.qpos[:] = angles = np.random.default_rng(3).uniform(*hand.limits.T)
    mujoco.mj_kinematics(model, data)
    positions = mirror_points(forward_kinematics(hand, angles)[0])
    for bone in range(1, hand.bone_count):
        assert np.allclose(data.body(f"{hand.joint_names[bone]} 0").xpos, positions[bone], atol=1e-9)
