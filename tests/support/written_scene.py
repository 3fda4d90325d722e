"""A scene written as formulas, with both hands on a turning object, for tests that compare whole ticks."""

import numpy as np

from manipnet.geometry import Array, quat_exp, quat_multiply
from manipnet.synthesis.model.layout import WINDOW_OFFSETS_S
from manipnet.synthesis.objects.shape import Shape
from manipnet.synthesis.synthesizer import HandScene

TICK_S = 0.1
"""Longer than a real tick, so that a few ticks see a whole grasp."""


def scenes_at(tick: int, shapes: list[Shape]) -> list[HandScene]:
    """Both hands close on a turning object; a third hand, without another wrist, passes a scaled one at a distance."""
    instants = tick * TICK_S + WINDOW_OFFSETS_S
    thing = np.stack(
        [np.concatenate([[0.3 + 0.05 * t, 1.0, -0.2], quat_exp(np.array([0.2, t, 0.1]))]) for t in instants]
    )
    right = _beside(instants, thing, side=1.0)
    left = _beside(instants, thing, side=-1.0)
    passing = right + np.array([0.0, 0.13, 0.05, 0.0, 0.0, 0.0, 0.0])
    return [
        HandScene("left", left, right, thing, shapes[0]),
        HandScene("right", right, left, thing, shapes[0]),
        HandScene("right", passing, None, thing, shapes[1], scale=1.3),
    ]


def _beside(instants: Array, thing: Array, side: float) -> Array:
    """A wrist that approaches the thing and leaves again, its palm (-z) toward it; a left one for side -1."""
    facing = quat_exp(np.array([0.0, np.pi if side > 0.0 else 0.0, 0.0]))
    poses = []
    for t, pose in zip(instants, thing, strict=True):
        gap = 0.055 + 0.15 * (t - 0.3) ** 2
        offset = np.array([0.11, 0.01, -gap * side])
        poses.append(
            np.concatenate([pose[:3] + offset, quat_multiply(quat_exp(np.array([0.1 * t, 0.0, 0.0])), facing)])
        )
    return np.stack(poses)
