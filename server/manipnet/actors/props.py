"""The props of one actor, and which of them a hand is about."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from manipnet.actors.transitions import HOLD_AFTER_S, REST_AFTER_S
from manipnet.geometry import Array
from manipnet.synthesis.objects.shape import Shape
from manipnet.synthesis.synthesizer import Side
from manipnet.tracking.timeline import BodyAtTick

PALM_M: Final[Mapping[Side, tuple[float, float, float]]] = {"right": (0.09, 0.0, -0.03), "left": (-0.09, 0.0, -0.03)}
"""A little in front of each palm, in its wrist frame: where what it takes will be."""
HYSTERESIS_M: Final = 0.03
"""Another prop must be this much nearer before a hand turns to it."""


@dataclass(frozen=True, slots=True, eq=False)
class Prop:
    """A tracked prop: `name` is its body's, `object` its shape's; `scale` resizes the shape about its origin."""

    name: str
    object: str
    shape: Shape
    scale: float = 1.0


def choose_prop(
    side: Side,
    T_world_wrist: Array,
    props: Sequence[Prop],
    bodies: Mapping[str, BodyAtTick],
    current: str | None,
) -> Prop | None:
    """The tracked prop nearest to the palm; the `current` one as long as it is not clearly farther.

    A current prop whose tracking is lost is kept while it may come back. None when no prop was tracked lately.
    """
    held = next((prop for prop in props if prop.name == current and prop.name in bodies), None)
    if held is not None and HOLD_AFTER_S < bodies[held.name].age_s <= REST_AFTER_S:
        return held
    tracked = [prop for prop in props if prop.name in bodies and bodies[prop.name].age_s <= HOLD_AFTER_S]
    if len(tracked) < 2:
        return tracked[0] if tracked else None
    palm = _carried(T_world_wrist.tolist(), PALM_M[side])
    ranges = [
        _distance_range(palm, prop, bodies[prop.name].pose, HYSTERESIS_M if prop is held else 0.0) for prop in tracked
    ]
    within_m = min(most_m for _, most_m in ranges)
    rivals = [prop for prop, (least_m, _) in zip(tracked, ranges, strict=True) if least_m <= within_m]
    if len(rivals) == 1:  # far enough from all others: no need to look at surfaces
        return rivals[0]
    exact = [palm_distance(palm, p, bodies[p.name].pose) - (HYSTERESIS_M if p is held else 0.0) for p in rivals]
    return rivals[exact.index(min(exact))]


def _distance_range(
    p_palm: Sequence[float], prop: Prop, T_world_object: Array, advantage_m: float
) -> tuple[float, float]:
    """Between what the distance of a world point to a prop's surface is, less an advantage: distances change no faster
    than one moves, and the one at its origin is known."""
    away_m = math.dist(p_palm, T_world_object[:3].tolist()) - advantage_m
    return away_m - prop.shape.reach_m * prop.scale, away_m + prop.shape.distance_at_origin_m * prop.scale


def palm_distance(p_palm: Sequence[float], prop: Prop, T_world_object: Array) -> float:
    """Signed distance of a world point to a prop's surface, metres."""
    x, y, z = _carried_back(T_world_object.tolist(), p_palm)
    return prop.shape.distance((x / prop.scale, y / prop.scale, z / prop.scale)) * prop.scale


def _carried(T_a_b: Sequence[float], p_b: Sequence[float]) -> tuple[float, float, float]:
    """A point of frame b in frame a; NumPy would take ten times as long for one point."""
    px, py, pz, x, y, z, w = T_a_b
    dx, dy, dz = p_b
    tx, ty, tz = 2.0 * (y * dz - z * dy), 2.0 * (z * dx - x * dz), 2.0 * (x * dy - y * dx)
    return (
        px + dx + w * tx + y * tz - z * ty,
        py + dy + w * ty + z * tx - x * tz,
        pz + dz + w * tz + x * ty - y * tx,
    )


def _carried_back(T_a_b: Sequence[float], p_a: Sequence[float]) -> tuple[float, float, float]:
    """The same point back: one of frame a in frame b."""
    px, py, pz, x, y, z, w = T_a_b
    dx, dy, dz = p_a[0] - px, p_a[1] - py, p_a[2] - pz
    tx, ty, tz = 2.0 * (dy * z - dz * y), 2.0 * (dz * x - dx * z), 2.0 * (dx * y - dy * x)
    return (
        dx + w * tx + ty * z - tz * y,
        dy + w * ty + tz * x - tx * z,
        dz + w * tz + tx * y - ty * x,
    )
