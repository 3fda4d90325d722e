"""Poses that a finger may end in, in the wrist frame, and what each costs.

The costs make a grasp look like a person's. The end joint bends two thirds as far as the middle one, neighbours are
alike, and knuckle and middle joint bend together: two such components explain four fifths of all grasps (Santello,
Flanders and Soechting 1998).
"""

from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np

from manipnet.geometry import Array
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet_tools.generate.contact import Body

POINTS: Final = 4
RELAXED: Final = np.radians([5, 5, 10, 12, *4 * (22, 0, 30, 18)])
"""A hand that does nothing, degrees; its fingers lie beside each other, bent a little."""
_ACROSS: Final = np.radians([-6.0, 0.0, 6.0])


@dataclass(frozen=True, eq=False)
class FingerTable:
    """Poses of one finger, `R` rows."""

    columns: slice
    """Of the hand's angles."""
    capsules: slice
    """Of the hand's capsules."""
    angles: Array
    """`(R, 4)`"""
    points: Array
    """`(R, 3, S, 3)` on the axes of its capsules."""
    pads: Array
    """`(R, 3)` where its pad looks."""
    sides: Array
    """`(R, 3)` the thumb side of its middle bone."""
    costs: Array
    """`(R,)` how unusual a pose is."""


@dataclass(frozen=True, eq=False)
class Tables:
    """A hand with the tables of its five fingers."""

    hand: Hand
    body: Body
    fingers: tuple[FingerTable, ...]


def tables_of(hand: Hand) -> Tables:
    """The tables of a hand with the free hand's layout."""
    body = Body(hand.skeleton, hand.chains.starts, hand.chains.ends, hand.radii, hand.limits)
    return Tables(
        hand, body, (_table(hand, 0, _thumb_rows(hand)), *(_table(hand, f, _finger_rows(hand, f)) for f in range(1, 5)))
    )


def _finger_rows(hand: Hand, finger: int) -> Array:
    limits = hand.limits[4 * finger : 4 * finger + 4]
    rows = []
    for knuckle, middle, coupling in product(
        np.radians(np.arange(-14, 90, 8)), np.radians(np.arange(2, 111, 8)), (0.4, 0.67)
    ):
        for across in _ACROSS * max(np.cos(knuckle), 0.3):
            rows.append((knuckle, across, middle, coupling * middle))
    return np.clip(rows, *limits.T)


def _thumb_rows(hand: Hand) -> Array:
    low, high = hand.limits[:4].T
    steps = (9, 7, 5, 4)
    return np.array(list(product(*(np.linspace(low[k] + 0.03, high[k] - 0.03, steps[k]) for k in range(4)))))


def _table(hand: Hand, finger: int, rows: Array) -> FingerTable:
    columns, capsules = slice(4 * finger, 4 * finger + 4), slice(4 + 3 * finger, 7 + 3 * finger)
    angles = np.tile(RELAXED, (len(rows), 1))
    angles[:, columns] = rows
    positions, rotations = forward_kinematics(hand, angles)
    starts, ends = hand.capsules[capsules].T
    share = np.linspace(0.0, 1.0, POINTS)[:, None]
    points = positions[:, starts, None] + share * (positions[:, ends] - positions[:, starts])[:, :, None]
    last, middle = hand.fingers[finger][-2], hand.fingers[finger][-3]
    hinge = np.einsum("rij,j->ri", rotations[:, hand.parents[last]], hand.axes[columns][3])
    along = positions[:, ends[2]] - positions[:, starts[2]]
    pads = np.cross(hinge, along)
    sides = -hinge if finger == 0 else np.einsum("rij,j->ri", rotations[:, middle], hand.axes[columns][2])
    norms = [np.linalg.norm(v, axis=1, keepdims=True) for v in (pads, sides)]
    costs = _thumb_costs(rows) if finger == 0 else _finger_costs(rows)
    return FingerTable(columns, capsules, rows, np.ascontiguousarray(points), pads / norms[0], sides / norms[1], costs)


def _finger_costs(rows: Array) -> Array:
    knuckle, across, middle, end = rows.T
    together = (knuckle - 0.15 - 0.55 * middle) / 0.6
    return 0.25 * (
        together**2 + ((middle - 0.7) / 0.9) ** 2 + (across / 0.15) ** 2 + ((end - 0.67 * middle) / 0.35) ** 2
    )


def _thumb_costs(rows: Array) -> Array:
    """The thumb opposes by abduction at its root and by its end joint; the two flexions between change less."""
    return 0.5 * np.sum(((rows - [0.2, 0.15, 0.2, 0.25]) / [0.35, 0.45, 0.35, 0.5]) ** 2, axis=1)
