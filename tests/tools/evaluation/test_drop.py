"""The drop test on hands whose answer is known: what must be held, and what must not."""

import numpy as np
import pytest
import trimesh

from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.objects.mesh import closed_mesh
from manipnet.synthesis.objects.shape import build_shape
from manipnet_tools.evaluation import metrics
from manipnet_tools.evaluation.shell import THICKNESS_M, shell_pieces

pytest.importorskip("mujoco")

from manipnet_tools.evaluation import drop, drop_cells

HAND = shipped_hand()
HALF = 0.02
DOWN = np.array([0.0, -1.0, 0.0])
OPEN_HAND = forward_kinematics(HAND, np.zeros(HAND.angle_count))[0]
AWAY = np.array([0.0, 0.5, 0.0])
THUMB, INDEX = (4, 17), (7, 18)
"""First and last joint of the last segments."""


@pytest.fixture(scope="module")
def cube():
    box = trimesh.creation.box((2 * HALF, 2 * HALF, 2 * HALF))
    return build_shape(closed_mesh(box.vertices, box.faces, "cube"))


@pytest.fixture(scope="module")
def test(cube):
    return drop.DropTest(cube, HAND)


def segment_at(joints: np.ndarray, ends: tuple[int, int], side: int, gap: float = 0.0) -> None:
    """Lay a segment along z beside the cube, on the side `side` (1 or -1) of x."""
    (capsule,) = np.flatnonzero((HAND.capsules == ends).all(axis=1))
    length = np.linalg.norm(HAND.offsets[ends[1]])
    x = side * (HALF + gap + HAND.radii[capsule])
    joints[list(ends)] = [[x, 0.0, z] for z in (-0.5 * length, 0.5 * length)]


def pinch(gap: float) -> np.ndarray:
    """A hand far above the cube, but for the last segments of thumb and index finger on opposite sides of it."""
    joints = OPEN_HAND + AWAY
    segment_at(joints, THUMB, 1, gap)
    segment_at(joints, INDEX, -1, gap)
    return joints


def test_a_pinch_holds_a_cube(test):
    fall = test.fall([pinch(0.0)], DOWN)
    assert fall.held
    assert fall.moved_m < 0.002


def test_fingers_that_do_not_reach_the_cube_drop_it(test):
    fall = test.fall([pinch(0.006)], DOWN)
    assert not fall.held
    assert fall.moved_m == pytest.approx(0.5 * 9.81 * 0.5**2, rel=0.01)


def test_one_finger_drops_a_cube(test):
    joints = OPEN_HAND + AWAY
    segment_at(joints, THUMB, 1)
    assert not test.fall([joints], DOWN).held


def test_an_open_hand_beside_the_cube_drops_it(test):
    palm_beside = OPEN_HAND[:, [2, 0, 1]] - [OPEN_HAND[9, 2], 0.0, 0.0]
    palm_beside += [HALF + HAND.radii.max(), -OPEN_HAND[9, 0], 0.0]
    assert not test.fall([palm_beside], DOWN).held


def test_a_flat_hand_below_the_cube_bears_it(test):
    """The palm faces up, in the right hand's frame -z; the cube stands over the middle finger's knuckle."""
    palm_up = (OPEN_HAND - OPEN_HAND[8]) * [1.0, 1.0, -1.0]
    palm_up = palm_up[:, [0, 2, 1]] - [0.0, HALF + HAND.radii[1], 0.0]
    gaps = metrics.capsule_gaps(HAND, palm_up[None], np.array([[0.0, 0, 0, 0, 0, 0, 1]]), test._shape)
    assert gaps.closest[0] > -0.004
    assert test.fall([palm_up], DOWN).held


@pytest.mark.parametrize("gap", [-0.012, -HALF])
def test_fingers_stuck_in_the_cube_do_not_hold_it(test, gap):
    assert not test.fall([pinch(gap)], DOWN).held


def test_hands_four_centimetres_inside_do_not_hold():
    box = trimesh.creation.box((0.16, 0.16, 0.16))
    test = drop.DropTest(build_shape(closed_mesh(box.vertices, box.faces, "box")), HAND)
    fist = OPEN_HAND - OPEN_HAND[9] + [0.08 - 0.04, 0.0, 0.0]
    assert not test.fall([fist], DOWN).held


def test_two_hands_hold_what_one_cannot(cube):
    left, right = OPEN_HAND + AWAY, OPEN_HAND + AWAY
    segment_at(left, THUMB, 1)
    segment_at(right, THUMB, -1)
    assert drop.DropTest(cube, HAND, 2).fall([left, right], DOWN).held


def test_pieces_cover_the_surface_and_leave_the_inside_open():
    ring = trimesh.creation.torus(0.03, 0.008)
    pieces = shell_pieces(closed_mesh(ring.vertices, ring.faces, "ring"))
    points = np.concatenate(pieces)
    assert 80 <= len(pieces) <= 120
    across = np.hypot(np.hypot(points[:, 0], points[:, 1]) - 0.03, points[:, 2])
    assert across.min() > 0.008 - THICKNESS_M - 0.0005  # between the outer and the inner skin
    assert across.max() < 0.0081
    assert max(np.ptp(piece, axis=0).max() for piece in pieces) < 0.025


def test_a_finger_that_enters_the_object_ends_there(test):
    """The middle segment of the index finger pierces the cube; its last one is on the other side."""
    joints = OPEN_HAND + AWAY
    joints[6], joints[7], joints[18] = [-0.03, 0.0, 0.0], [0.03, 0.0, 0.0], [0.03, 0.03, 0.0]
    (out,) = test._taken_out(metrics.capsule_axes(HAND, joints[None]))
    assert HAND.capsules[out].tolist() == [[6, 7], [7, 18]]


@pytest.mark.slow
def test_captured_fingers_hold_and_hands_beside_the_object_or_in_it_do_not(cases):
    case = cases["cyl_med3"]
    judge = drop_cells.DropCells(case, most=12)
    del judge.cells["drop_both"]
    shares = {
        toward_back_m: judge.shares(
            {side: p + np.array([0.0, 0.0, toward_back_m]) for side, p in case.captured.items()}
        )
        for toward_back_m in (-0.04, 0.0, 0.04)
    }
    for cell in judge.cells:
        assert shares[0.0][cell] >= 0.9
        assert shares[0.04][cell] <= 0.2
        assert shares[-0.04][cell] <= 0.4


def test_cells_are_frames_in_which_these_hands_alone_touch_the_lifted_object(cases):
    case = cases["mug1"]
    found = drop_cells.cells(case, most=10_000)
    for name, cell in found.items():
        assert case.lifted[cell.frames].all(), name
        for side in ("left", "right"):
            touches = case.gaps[side].closest[cell.frames] < metrics.CONTACT_M
            assert touches.all() if side in cell.sides else not touches.any()
    assert [len(cell.frames) for cell in drop_cells.cells(case, most=20).values()] == [20, 20, 0]
