"""Objects that are too wide for one hand: flat hands press from two sides, and only together they hold."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import Array, mirror_points, mirror_poses, mirror_quats
from manipnet.synthesis.hand.hand import Hand
from manipnet_tools.generate.contact import Space
from manipnet_tools.generate.finger_tables import Tables
from manipnet_tools.generate.forces import carried, cone_columns, squeeze
from manipnet_tools.generate.grasps import Grasp
from manipnet_tools.generate.mirrored import Surface
from manipnet_tools.generate.proposals import cone
from manipnet_tools.generate.simulate import Placed, Simulation, aims_of, contacts, pose_of

SQUEEZE_N: Final = 30.0
"""Both hands together."""
OPPOSED: Final = 0.8
"""Cosine between the directions in which the palms of a pair press."""
MOST_PAIRS: Final = 60
DOWNS: Final = cone(np.array([0.0, -1.0, 0.0]))
"""Directions of gravity in which a pair must hold, in the object's frame."""


@dataclass(frozen=True, eq=False)
class _Pressing:
    """What one hand does, as a right hand: its grasp, the capsules that touch, and where, in the object's frame."""

    grasp: Grasp
    capsules: NDArray[np.intp]
    points: Array
    normals: Array


class TwoHands:
    """Tries pairs of hands on one object."""

    def __init__(self, tables: Tables, shape: Surface, spaces: tuple[Space, Space], pieces: Sequence[Array]) -> None:
        """`spaces` are that of the object and that of its mirror image, in which left hands are found."""
        self._tables, self._shape, self._spaces = tables, shape, spaces
        self._simulation = Simulation([tables.hand, mirrored_hand(tables.hand)], shape, pieces)

    def pairs(
        self, right: Sequence[Grasp], left: Sequence[Grasp], wanted: int, refused: Counter[str]
    ) -> list[tuple[Grasp, Grasp]]:
        """Pairs that hold; each hand is in one of them at most."""
        found: list[tuple[Grasp, Grasp]] = []
        rights = [_Pressing(grasp, *contacts(self._tables, self._spaces[0], grasp)) for grasp in right]
        lefts = [_Pressing(grasp, *contacts(self._tables, self._spaces[1], grasp)) for grasp in left]
        opposed = [
            (one, other)
            for one in rights
            for other in lefts
            if one.grasp.along @ mirror_points(other.grasp.along) < -OPPOSED
        ]
        for one, other in opposed[:MOST_PAIRS]:
            used = any(one.grasp is a or other.grasp is b for a, b in found)
            if len(found) < wanted and not used and self._hold(one, other, refused):
                found.append((one.grasp, other.grasp))
        return found

    def _hold(self, right: _Pressing, left: _Pressing, refused: Counter[str]) -> bool:
        points = np.concatenate([right.points, mirror_points(left.points)])
        normals = np.concatenate([right.normals, mirror_points(left.normals)])
        centre = self._shape.center_of_mass
        if not carried(cone_columns(points, normals, centre), DOWNS).all():
            refused["does not carry the object"] += 1
            return False
        forces = squeeze(points, normals, centre, SQUEEZE_N)
        count, hand = len(right.points), self._tables.hand
        placed = [
            Placed(pose_of(right.grasp), right.grasp.angles, _aims(hand, right, forces[:count])),
            Placed(
                mirror_poses(pose_of(left.grasp)), left.grasp.angles, _aims(hand, left, mirror_points(forces[count:]))
            ),
        ]
        if not self._simulation.holds(placed, DOWNS):
            refused["falls in the simulator"] += 1
            return False
        return True


def mirrored_hand(hand: Hand) -> Hand:
    """The left hand that is the mirror image of a right one, x to -x, with the same angles.

    It is for the simulator only: skin and sensors stay those of the right hand.
    """
    return replace(
        hand,
        offsets=mirror_points(hand.offsets),
        axes=-mirror_points(hand.axes),  # an axis of rotation is a pseudovector
        rest_quats=mirror_quats(hand.rest_quats),
    )


def _aims(hand: Hand, pressing: _Pressing, forces: Array) -> Array:
    return aims_of(hand, pressing.grasp, pressing.capsules, pressing.points, forces)
