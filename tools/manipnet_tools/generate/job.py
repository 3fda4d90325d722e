"""Makes one take. Everything follows from its number and the seed, whichever process makes it and in whatever order."""

import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from manipnet.geometry import SIDES
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.objects.mesh import ClosedMesh
from manipnet.synthesis.objects.shape import build_shape
from manipnet_tools.generate.bank import Bank, fill_bank
from manipnet_tools.generate.finger_tables import Tables, tables_of
from manipnet_tools.generate.free_hand import free_hand
from manipnet_tools.generate.motions import RATE_HZ, play
from manipnet_tools.generate.proportions import HANDS, drawn_proportions, proportioned
from manipnet_tools.generate.proposals import Pinches, pinches_of
from manipnet_tools.generate.scenes import Director
from manipnet_tools.generate.shapes import make_shape
from manipnet_tools.takes.take_file import GeneratedTake

TAKE_S: Final = 30.0
LEAST_GRASPS: Final = 3
"""An object of which fewer are found is put aside, and the next one taken."""


@dataclass(frozen=True, eq=False)
class MadeTake:
    """A take with the mesh of its object."""

    name: str
    take: GeneratedTake
    mesh: ClosedMesh


def take_name(number: int) -> str:
    """The name of the folder of a take."""
    return f"generated-{number:05d}"


def hand_name(number: int) -> str:
    """The name of one of the hands of a set."""
    return f"free-{number:02d}"


@lru_cache(maxsize=2 * HANDS)
def hand_of(number: int, seed: int) -> Hand:
    """One of the hands of a set."""
    proportions = drawn_proportions(number, seed)
    name = f"free hand, size {proportions.size}, fingers {proportions.fingers}, thickness {proportions.thickness}"
    return proportioned(free_hand(), proportions, name)


def make_take(number: int, seed: int) -> MadeTake:
    """One take of one object by hands of one kind."""
    started = time.process_time()
    hand_number = 0 if number % 8 == 0 else 1 + number % (HANDS - 1)
    tables, pinches = _tables(hand_number, seed)
    for turn in range(10):
        rng = np.random.default_rng([seed, number, turn])
        made = make_shape(10 * number + turn, seed)
        with tempfile.TemporaryDirectory() as cache:
            shape = build_shape(made.mesh, Path(cache))
        bank = fill_bank(tables, pinches, made, shape, rng)
        if all(sum(grasp.side == side for grasp in bank.grasps) >= LEAST_GRASPS for side in SIDES):
            break
    grasped_s = time.process_time() - started
    director = Director(bank.grasps, made.mesh.vertices, rng)
    scene = director.direct(TAKE_S)
    obj, wrists, angles = play(scene, tables.hand.limits, shape, rng)
    notes: dict[str, Any] = {
        "shape": made.kind,
        "events": director.events,
        "grasps": _counts(bank),
        "smoothness_cm_s2": {side: round(_smoothness(tables.hand, angles[side]), 1) for side in SIDES},
        "grasps_cpu_s": round(grasped_s, 2),
        "cpu_s": round(time.process_time() - started, 2),
    }
    take = GeneratedTake(RATE_HZ, hand_name(hand_number), made.mesh.name, obj, wrists, angles, notes)
    return MadeTake(take_name(number), take, made.mesh)


@lru_cache(maxsize=HANDS)
def _tables(number: int, seed: int) -> tuple[Tables, tuple[Pinches, Pinches]]:
    tables = tables_of(hand_of(number, seed))
    rng = np.random.default_rng([seed, 11, number])
    return tables, (pinches_of(tables, False, rng), pinches_of(tables, True, rng))


def _counts(bank: Bank) -> dict[str, dict[str, int]]:
    counters: dict[str, Counter[str]] = {
        "tried": bank.tried,
        "found": bank.found,
        "verified": bank.verified,
        "refused": bank.refused,
    }
    return {name: dict(sorted(counter.items())) for name, counter in counters.items()}


def _smoothness(hand: Hand, angles: np.ndarray) -> float:
    """Mean second difference of the joints in the wrist frame at 60 Hz, times 3600, cm/s² (`docs/results.md`)."""
    positions = forward_kinematics(hand, angles[::2])[0]
    return float(100.0 * 3600.0 * np.linalg.norm(np.diff(positions, n=2, axis=0), axis=2).mean())
