"""How fingers and thumb are chosen at a pose of the wrist: around a bar of 4 cm, whose distances are exact."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from manipnet_tools.generate.contact import CELL_M, MARGIN_M, Space, look
from manipnet_tools.generate.finger_tables import RELAXED, Tables, tables_of
from manipnet_tools.generate.forces import SIDES
from manipnet_tools.generate.free_hand import free_hand
from manipnet_tools.generate.grasps import SHIFT_M, Grasp, find_grasp, shifted_grasp
from manipnet_tools.generate.proposals import Proposal

pytestmark = pytest.mark.slow
RADIUS_M, HALF_LENGTH_M = 0.02, 0.1
RING, LITTLE = slice(13, 16), slice(16, 19)
"""Capsules of these fingers."""


@pytest.fixture(scope="module")
def tables() -> Tables:
    return tables_of(free_hand())


@pytest.fixture(scope="module")
def bar() -> Space:
    """A bar along y."""
    half = np.array([RADIUS_M, HALF_LENGTH_M, RADIUS_M]) + MARGIN_M
    counts = np.ceil(2.0 * half / CELL_M).astype(int) + 1
    x, y, z = np.meshgrid(*(CELL_M * np.arange(n) - h for n, h in zip(counts, half, strict=True)), indexing="ij")
    across, along = np.hypot(x, z) - RADIUS_M, np.abs(y) - HALF_LENGTH_M
    outside = np.hypot(np.maximum(across, 0.0), np.maximum(along, 0.0))
    return Space((outside + np.minimum(np.maximum(across, along), 0.0)).astype(np.float32), -half, CELL_M)


@pytest.fixture(scope="module")
def proposal(tables: Tables) -> Proposal:
    """The palm on the bar, fingers around it."""
    knuckle, palm = tables.hand.offsets[8], tables.hand.radii[1]
    place = -np.array([knuckle[0] - 0.005, 0.0, knuckle[2] - palm - RADIUS_M - 0.002])
    wanted = np.array([[0.6, 1.0, 1.2]] * 5)
    return Proposal("bar", np.eye(3), place, wanted, (1, 2), np.array([0.0, 0.0, -1.0]), SIDES)


@pytest.fixture(scope="module")
def grasp(tables: Tables, bar: Space, proposal: Proposal) -> Grasp:
    return found(tables, bar, proposal)


def found(tables: Tables, bar: Space, proposal: Proposal) -> Grasp:
    refused = Counter[str]()
    grasp = find_grasp(tables, bar, proposal, np.zeros(3), refused)
    assert grasp is not None, refused
    return grasp


def test_the_thumb_opposes_the_fingers(tables: Tables, bar: Space, grasp: Grasp):
    normals = look(bar, tables.body, grasp.angles, grasp.turn, grasp.place)[2]
    assert grasp.touching[4:7].any(), "the thumb touches"
    fingers = normals[7:][grasp.touching[7:]].mean(axis=0)
    assert normals[6] @ fingers < -0.3


def test_fingers_whose_knuckles_are_far_stay_away(tables: Tables, bar: Space, proposal: Proposal):
    turn = np.eye(3)
    turn[1:, 1:] = [[np.cos(0.6), np.sin(0.6)], [-np.sin(0.6), np.cos(0.6)]]  # the little finger's side is lifted
    lifted = replace(proposal, turn=turn, place=turn @ proposal.place + [0.0, 0.0, 0.012])
    ring, little = look(bar, tables.body, RELAXED, lifted.turn, lifted.place)[0][2:4]
    assert ring < little
    touching = [
        found(tables, bar, replace(lifted, nearest_m=nearest)).touching
        for nearest in (little + 0.001, 0.5 * (ring + little), ring - 0.001)
    ]
    assert [t[RING].any() for t in touching] == [True, True, False]
    assert [t[LITTLE].any() for t in touching] == [True, False, False]


def test_a_hand_that_shifts_goes_on_touching(tables: Tables, bar: Space, grasp: Grasp):
    rng = np.random.default_rng(0)
    shifts = [shifted for _ in range(40) if (shifted := shifted_grasp(tables, bar, grasp, rng)) is not None]
    assert len(shifts) >= 2
    for shifted in shifts:
        gaps = look(bar, tables.body, shifted.angles, shifted.turn, shifted.place)[0]
        nearest = gaps[4:].reshape(5, 3).min(axis=1)
        assert (nearest[grasp.touching[4:].reshape(5, 3).any(axis=1)] < 0.005).all()
        assert 0.0 < np.linalg.norm(shifted.place - grasp.place) < 5.0 * SHIFT_M
