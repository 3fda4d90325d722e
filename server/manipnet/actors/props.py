"""The props of one actor, and the choice of the prop to which a hand belongs."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from manipnet.actors.transitions import HOLD_AFTER_S, REST_AFTER_S
from manipnet.geometry import Array
from manipnet.synthesis.objects.shape import Shape
from manipnet.tracking.tick import BodyAtTick
from manipnet.wire import Side

PALM_M: Final[Mapping[Side, tuple[float, float, float]]] = {"right": (0.09, 0.0, -0.03), "left": (-0.09, 0.0, -0.03)}
"""A point a little in front of each palm, in the wrist frame: a prop that is taken will be there."""
HYSTERESIS_M: Final = 0.03
"""A hand turns to another prop only if that is nearer by this much."""


@dataclass(frozen=True, slots=True, eq=False)
class Prop:
    """An object that an actor may hold.

    `name` is the name of its tracked body, `object` that of its mesh in the catalogue; `scale` resizes the mesh about
    its origin.
    """

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
    """The tracked prop nearest to the palm. The `current` one stays unless another is clearly nearer.

    A current prop whose tracking is lost stays while it may come back. None if no prop was tracked lately.
    """
    current_prop = next((prop for prop in props if prop.name == current and prop.name in bodies), None)
    if current_prop is not None and HOLD_AFTER_S < bodies[current_prop.name].age_s <= REST_AFTER_S:
        return current_prop
    tracked = [prop for prop in props if prop.name in bodies and bodies[prop.name].age_s <= HOLD_AFTER_S]
    if len(tracked) < 2:
        return tracked[0] if tracked else None
    palm = _to_world(T_world_wrist.tolist(), PALM_M[side])
    ranges = [
        _distance_range(palm, prop, bodies[prop.name].pose, HYSTERESIS_M if prop is current_prop else 0.0)
        for prop in tracked
    ]
    nearest_m = min(upper_m for _, upper_m in ranges)
    rivals = [prop for prop, (lower_m, _) in zip(tracked, ranges, strict=True) if lower_m <= nearest_m]
    if len(rivals) == 1:  # all others are farther, so the surfaces need not be searched
        return rivals[0]
    exact_m = [
        palm_distance(palm, prop, bodies[prop.name].pose) - (HYSTERESIS_M if prop is current_prop else 0.0)
        for prop in rivals
    ]
    return rivals[exact_m.index(min(exact_m))]


def _distance_range(
    p_palm: Sequence[float], prop: Prop, T_world_object: Array, advantage_m: float
) -> tuple[float, float]:
    """Lower and upper bound of the distance from a world point to a prop's surface, less an advantage, in metres.

    A distance changes no faster than the point moves, and the distance at the prop's origin is known.
    """
    away_m = math.dist(p_palm, T_world_object[:3].tolist()) - advantage_m
    return away_m - prop.shape.reach_m * prop.scale, away_m + prop.shape.distance_at_origin_m * prop.scale


def palm_distance(p_palm: Sequence[float], prop: Prop, T_world_object: Array) -> float:
    """Signed distance in metres from a world point `(3,)` to a prop's surface, negative inside."""
    x, y, z = _to_local(T_world_object.tolist(), p_palm)
    return prop.shape.distance((x / prop.scale, y / prop.scale, z / prop.scale)) * prop.scale


def _to_world(T_a_b: Sequence[float], p_b: Sequence[float]) -> tuple[float, float, float]:
    """A point given in frame b, in frame a; NumPy would take ten times as long for one point."""
    px, py, pz, x, y, z, w = T_a_b
    dx, dy, dz = p_b
    tx, ty, tz = 2.0 * (y * dz - z * dy), 2.0 * (z * dx - x * dz), 2.0 * (x * dy - y * dx)
    return (
        px + dx + w * tx + y * tz - z * ty,
        py + dy + w * ty + z * tx - x * tz,
        pz + dz + w * tz + x * ty - y * tx,
    )


def _to_local(T_a_b: Sequence[float], p_a: Sequence[float]) -> tuple[float, float, float]:
    """A point given in frame a, in frame b: the inverse of `_to_world`."""
    px, py, pz, x, y, z, w = T_a_b
    dx, dy, dz = p_a[0] - px, p_a[1] - py, p_a[2] - pz
    tx, ty, tz = 2.0 * (dy * z - dz * y), 2.0 * (dz * x - dx * z), 2.0 * (dx * y - dy * x)
    return (
        dx + w * tx + ty * z - tz * y,
        dy + w * ty + tz * x - tx * z,
        dz + w * tz + tx * y - ty * x,
    )
