"""How a hand comes to a grasp: from which side, and how far it opens."""

from itertools import product
from typing import Final

import numpy as np

from manipnet.geometry import Array
from manipnet_tools.generate.contact import Space, look
from manipnet_tools.generate.finger_tables import Tables
from manipnet_tools.generate.grasps import Grasp

AWAY_M: Final = 0.07
_WIDER: Final = np.array([-0.35, 0.1, -0.15, -0.2, *4 * (-0.4, 0.0, -0.45, -0.3)])
_STRAIGHT: Final = np.array([-0.15, 0.1, 0.05, 0.05, *4 * (0.1, 0.0, 0.15, 0.1)])


def approach(tables: Tables, space: Space, grasp: Grasp) -> tuple[Array, Array]:
    """The open hand `(A,)` and the direction `(3,)` in which it is before it closes, in the object's frame.

    Among some directions and two ways to open, those are chosen with which the least of the hand goes through the
    object. Through a handle, only straight fingers pass.
    """
    limits = tables.hand.limits
    wider = np.clip(grasp.angles + _WIDER, *limits.T)
    straight = np.clip(np.where(np.arange(20) % 4 == 1, grasp.angles, _STRAIGHT), *limits.T)
    x, y, z = grasp.turn.T
    backs = [-grasp.along, z, -x, z - x, z + 0.7 * y, -x + 0.7 * y]
    found = []
    for number, (back, opened) in enumerate(product(backs, (wider, straight))):
        back = back / np.linalg.norm(back)
        found.append((_inside(tables, space, grasp, back, opened) + 2e-4 * number, opened, back))
    _, opened, back = min(found, key=lambda entry: entry[0])
    return opened, back


def _inside(tables: Tables, space: Space, grasp: Grasp, back: Array, opened: Array) -> float:
    """How deep the hand is in the object on its way, metres, summed over the way."""
    deep = 0.0
    for share in np.linspace(1.0, 0.0, 6):
        place = grasp.place + share * AWAY_M * back
        deep += max(-0.002 - float(look(space, tables.body, opened, grasp.turn, place)[0].min()), 0.0)
    for share in (0.25, 0.5, 0.75):
        angles = opened + share * (grasp.angles - opened)
        deep += max(-0.002 - float(look(space, tables.body, angles, grasp.turn, grasp.place)[0].min()), 0.0)
    return deep
