"""What a hand does while it holds: the object moves in the hand, there and back, or the hand takes another grip."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.random import Generator

from manipnet.geometry import Array, quat_conjugate, quat_exp, quat_log, quat_multiply
from manipnet_tools.generate.bank import Held, apart, of_side
from manipnet_tools.generate.in_hand import STEPS
from manipnet_tools.generate.motions import Shift

HANDS_APART_M: Final = 0.022
_STEP_S: Final = (0.03, 0.12)
"""How long an object takes for a step in the hand."""
_REGRIPS: Final = 0.5
"""How often a hand that may take another grip does so instead of moving the object in the hand."""
_REGRIP_S: Final = (0.2, 0.6)
_REGRIP_M: Final = 0.06
"""To another grip, joints move by at most this on average."""
_LIFTED_M: Final = 0.015
"""So far a hand leaves the object on the way to another grip."""


def drawn_shifts(
    grasps: Sequence[Held], grasp: Held, contact_s: float, release_s: float, beside: Held | None, rng: Generator
) -> tuple[Shift, ...]:
    """What the hand does from contact to release. `beside` is a grasp of the other hand, which must have its place."""
    free = [other for other in grasps if beside is None or apart(other, beside, HANDS_APART_M)]
    shifts: list[Shift] = []
    now = contact_s + float(rng.uniform(0.05, 0.4))
    while now < release_s - 0.1:
        others = _near_by(free, grasp) if rng.random() < _REGRIPS else []
        if others:
            other, length_s = others[int(rng.integers(len(others)))], float(rng.uniform(*_REGRIP_S))
            shifts += regrip(now, length_s, grasp, other, float(rng.uniform(0.15, 0.7)))
            grasp, now = other, now + length_s
        elif grasp.ways:
            way = grasp.ways[int(rng.integers(len(grasp.ways)))][: int(rng.integers(1, STEPS + 1))]
            shifts += there_and_back(now, float(rng.uniform(*_STEP_S)), grasp, way)
            now = shifts[-1].end_s
        now += max(float(rng.uniform(-0.4, 0.4)), 0.02)
    return tuple(shift for shift in shifts if shift.end_s < release_s - 0.05)


def there_and_back(start_s: float, step_s: float, grasp: Held, way: Sequence[tuple[Array, Array]]) -> list[Shift]:
    """The object moves along a way and comes back. Each step begins while the one before it ends, without a stop."""
    steps = [*way, *way[-2::-1], (grasp.pose, grasp.angles)]
    starts = start_s + step_s * np.arange(len(steps))
    return [Shift(float(at), float(at) + 2.0 * step_s, *step) for at, step in zip(starts, steps, strict=True)]


def regrip(start_s: float, length_s: float, before: Held, after: Held, opened: float) -> list[Shift]:
    """The hand takes another grip; on the way it leaves the object a little, its fingers `opened` by a share."""
    half_turn = quat_exp(0.5 * quat_log(quat_multiply(quat_conjugate(before.pose[3:]), after.pose[3:])))
    between = np.concatenate(
        [
            0.5 * (before.pose[:3] + after.pose[:3]) + 0.5 * _LIFTED_M * (before.back + after.back),
            quat_multiply(before.pose[3:], half_turn),
        ]
    )
    angles, wide = 0.5 * (before.angles + after.angles), 0.5 * (before.opened + after.opened)
    return [
        Shift(start_s, start_s + 0.6 * length_s, between, angles + opened * (wide - angles)),
        Shift(start_s + 0.4 * length_s, start_s + length_s, after.pose, after.angles),
    ]


def _near_by(grasps: Sequence[Held], grasp: Held) -> list[Held]:
    """Other grasps by the same hand alone, to which it has not far to go."""
    return [
        other
        for other in of_side(grasps, grasp.side)
        if other is not grasp
        and other.pair == grasp.pair == -1
        and np.linalg.norm(other.joints - grasp.joints, axis=1).mean() < _REGRIP_M
    ]
