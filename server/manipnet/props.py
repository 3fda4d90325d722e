"""The props of one actor, and which of them a hand is about."""

import math
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from manipnet.config import ObjectConfig
from manipnet.geometry import Array
from manipnet.objects.library import library_names, load_library_mesh
from manipnet.objects.shape import Shape, build_shape, load_shape
from manipnet.presence import HOLD_AFTER_S, REST_AFTER_S
from manipnet.synthesis import Side
from manipnet.timeline import BodyAtTick

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


class Wardrobe:
    """The shapes a server has or can get: those of its rig, and the library, each built once. Thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._built: dict[tuple[str, str, float], Shape] = {}
        self._by_name: dict[str, Shape] = {}

    def load(self, config: ObjectConfig) -> Prop:
        """The prop of a rig's object. Raises `MeshError`."""
        with self._lock:
            key = (str(config.mesh.resolve()), config.unit, config.scale)
            if key not in self._built:
                self._built[key] = load_shape(config.mesh, config.unit, config.scale)
            shape = self._built[key]
            self._by_name.setdefault(shape.name, shape)
            return Prop(config.name, shape.name, shape)

    def names(self) -> tuple[str, ...]:
        """What `shape` can be asked for: the rig's meshes by file name, and the library."""
        with self._lock:
            return tuple(sorted({*self._by_name, *library_names()}))

    def shape(self, name: str) -> Shape:
        """A shape by name; one of the library is built on first use. Raises `MeshError`."""
        with self._lock:
            if name not in self._by_name:
                self._by_name[name] = build_shape(load_library_mesh(name))
            return self._by_name[name]

    def add(self, file: Path, unit: str = "m") -> Shape:
        """A mesh file more to choose from, in the place of one of the same name. Raises `MeshError`."""
        shape = load_shape(file, unit)  # takes a while: nobody should wait for the lock
        with self._lock:
            self._by_name[shape.name] = shape
        return shape

    def shapes(self) -> tuple[Shape, ...]:
        """Those built so far."""
        with self._lock:
            return tuple(self._by_name.values())


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
    nearest, least_m = tracked[0], math.inf
    # no exact distance for a prop that is farther than the nearest one even if it reaches all the way to the palm
    for bound_m, _, prop in sorted((_least_distance(palm, prop, bodies), i, prop) for i, prop in enumerate(tracked)):
        advantage_m = HYSTERESIS_M if prop is held else 0.0
        if bound_m - advantage_m < least_m:
            distance_m = palm_distance(palm, prop, bodies[prop.name].pose) - advantage_m
            if distance_m < least_m:
                nearest, least_m = prop, distance_m
    return nearest


def _least_distance(p_palm: Sequence[float], prop: Prop, bodies: Mapping[str, BodyAtTick]) -> float:
    return math.dist(p_palm, bodies[prop.name].pose[:3].tolist()) - prop.shape.reach_m * prop.scale


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
