"""Objects that move in the hand: a grasp changes step by step, and the fingers follow.

People do not keep to a grasp as a clamp does; they push, roll and turn what they hold (Elliott and Connolly 1984). Here
the wrist moves about the contacts along one twist for as long as the fingers can follow and the contacts still carry.
"""

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from manipnet.geometry import Array
from manipnet_tools.generate.contact import Space, look, settle
from manipnet_tools.generate.finger_tables import Tables
from manipnet_tools.generate.forces import carried, cone_columns
from manipnet_tools.generate.grasps import DEEPEST_M, OVERLAP_M, TOUCH_M, Grasp, arm_free, rotation
from manipnet_tools.generate.proposals import ONE_SIDED

STEP_M, STEP_RAD = 0.0035, 0.08
"""How far a wrist moves in one step, along and about each axis, one standard deviation."""
STEPS: Final = 8
"""An object moves by at most so many steps before it comes back."""
_ROUNDS: Final = 6


def moved_in_hand(tables: Tables, space: Space, grasp: Grasp, centre: Array, rng: Generator) -> tuple[Grasp, ...]:
    """The grasps of a hand in which the object moves along one random twist, step by step; none if it cannot move.

    `centre (3,)` is the object's centre of mass.
    """
    turned, moved = rotation(rng.normal(0.0, STEP_RAD, 3)), rng.normal(0.0, STEP_M, 3)
    points = look(space, tables.body, grasp.angles, grasp.turn, grasp.place)[1]
    pivot = points[grasp.touching].mean(axis=0)
    steps: list[Grasp] = []
    now = grasp
    for _ in range(STEPS):
        turn, place = np.ascontiguousarray(turned @ now.turn), pivot + turned @ (now.place - pivot) + moved
        following = _followed(tables, space, replace(now, turn=turn, place=place), grasp.touching, centre)
        if following is None:
            break
        steps.append(following)
        now = following
    return tuple(steps)


def _followed(tables: Tables, space: Space, grasp: Grasp, wanted: NDArray[np.bool_], centre: Array) -> Grasp | None:
    """The grasp with fingers that touch again with the capsules `wanted (C,)`, or nothing if it does not hold then."""
    stiff = np.concatenate([np.full(20, 1.0 / 0.3), np.full(3, 1.0 / 0.04), np.full(3, 1.0 / 0.003)])
    stiff[5:20:4] = 1.0 / 0.12
    x = settle(space, tables.body, grasp.angles, grasp.turn, grasp.place, wanted.astype(float), stiff, _ROUNDS)
    turn, place, angles = np.ascontiguousarray(grasp.turn @ rotation(x[20:23])), grasp.place + x[23:], x[:20].copy()
    gaps, points, normals, clear = look(space, tables.body, angles, turn, place)
    touching = np.asarray(gaps < TOUCH_M)
    if gaps.min() < -DEEPEST_M or clear < -OVERLAP_M or not arm_free(space, turn, place):
        return None
    if grasp.kind not in ONE_SIDED and not touching[4:7].any():
        return None
    on_surface = points[touching] - normals[touching] * (gaps + tables.hand.radii)[touching, None]
    if not carried(cone_columns(on_surface, normals[touching], centre), grasp.downs).all():
        return None
    return replace(grasp, turn=turn, place=place, angles=angles, touching=touching)
