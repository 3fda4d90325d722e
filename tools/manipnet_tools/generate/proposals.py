"""Where a hand might be when it holds an object: poses of the wrist, by type of grasp.

The types are the main branches of the taxonomy of Feix et al. 2016: power grasps around bars and bodies, hooks, pinches
and tripods, lateral pinches, discs held from above, and flat hands. All poses are of a right hand in the object's
frame.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.random import Generator

from manipnet.geometry import Array
from manipnet_tools.generate.finger_tables import Tables
from manipnet_tools.generate.forces import SIDES
from manipnet_tools.generate.mirrored import Surface
from manipnet_tools.generate.solids import Site

PAIRS: Final = 120_000
PER_WIDTH: Final = 24
WIDTH_STEP_M: Final = 0.005
WIDEST_PINCH_M: Final = 0.085
FACING: Final = 0.75
"""Cosine between a pad and the line to the other one."""
WIDEST_HELD_M: Final = 0.13
"""One hand does not reach around what is wider everywhere."""
CONE_RAD: Final = np.radians(30.0)
ONE_SIDED: Final = ("flat", "press")
"""Kinds in which all digits press from the same side."""
_FARTHEST_M: Final = 0.04
"""People hold with the fingers that are near: a ring or little finger takes part less often, the farther its knuckle is
from the object, and never beyond this."""
_POWER, _PRECISE, _HOOK, _FLAT = (0.6, 1.0, 1.2), (0.0, 0.15, 2.0), (0.8, 1.2, 1.0), (0.5, 0.5, 0.6)


@dataclass(frozen=True, eq=False)
class Proposal:
    """A pose of the wrist: `turn (3, 3)` and `place (3,)`; and what each digit shall do there.

    `wanted (5, 3)` is what a contact of each capsule of each digit is worth; digits with zeros are idle. `needed` are
    the digits that have to touch. `along (3,)` is the direction in which the hand arrives.
    """

    kind: str
    turn: Array
    place: Array
    wanted: Array
    needed: tuple[int, ...]
    along: Array
    downs: Array
    """`(n, 3)` the directions of gravity in which it has to hold: all, about one for a hook or a flat hand, or none for
    a hand that holds only together with another."""
    nearest_m: float = np.inf
    """The little finger stays away if its knuckle is farther from the object than this, and the ring finger too if both
    are."""


@dataclass(frozen=True, eq=False)
class Pinches:
    """Pairs of a thumb and a finger whose pads face each other, by the width between them: frames of the hand.

    `frames (n, 3, 3)` have the direction of approach, the line from the thumb to the finger and their cross product as
    columns, `middles (n, 3)` lie between the pads, `widths (n,)`.
    """

    frames: Array
    middles: Array
    widths: Array


def pinches_of(tables: Tables, lateral: bool, rng: Generator) -> Pinches:
    """The least unusual pinches of thumb and index finger; `lateral` ones press on the side of the finger."""
    thumb, index = tables.fingers[:2]
    a, b = rng.integers(len(thumb.costs), size=PAIRS), rng.integers(len(index.costs), size=PAIRS)
    radii = tables.hand.radii
    pads = index.sides[b] if lateral else index.pads[b]
    capsule = 1 if lateral else 2
    tips = thumb.points[a, 2, -2] + radii[6] * thumb.pads[a]
    others = index.points[b, capsule, 2 if lateral else -2] + radii[7 + capsule] * pads
    line = others - tips
    widths = np.linalg.norm(line, axis=1)
    line = line / np.maximum(widths, 1e-9)[:, None]
    facing = np.minimum(np.sum(line * thumb.pads[a], axis=1), -np.sum(line * pads, axis=1))
    costs = thumb.costs[a] + index.costs[b] + 2.0 * (1.0 - facing)
    costs[facing < FACING] = np.inf
    chosen = []
    for low in np.arange(0.0, 0.03 if lateral else WIDEST_PINCH_M, WIDTH_STEP_M):
        within = np.flatnonzero((widths >= low) & (widths < low + WIDTH_STEP_M) & np.isfinite(costs))
        chosen.append(within[np.argsort(costs[within])[:PER_WIDTH]])
    rows = np.concatenate(chosen)
    middles = 0.5 * (tips + others)[rows]
    return Pinches(_frames(middles - [0.05, 0.0, 0.0], line[rows]), middles, widths[rows])


def propose(
    tables: Tables,
    pinches: tuple[Pinches, Pinches],
    shape: Surface,
    corners: Array,
    sites: Sequence[Site],
    kinds: Sequence[str],
    rng: Generator,
) -> Proposal | None:
    """One pose of a random type, or nothing where the drawn place does not suit it.

    `corners (F, 3, 3)` are the triangles of the shape, and `pinches` those of the pads and of the finger's side.
    """
    kind = kinds[int(rng.integers(len(kinds)))]
    bars = [site for site in sites if site.kind in ("bar", "stick")]
    edges = [site for site in sites if site.kind in ("rim", "knob", "stick")]
    if kind in ("bar", "hook"):
        return _around(tables, _drawn(bars, rng), kind, rng) if bars else None
    if kind == "press":
        return _pressed(tables, shape, corners, rng)
    if kind in ("pinch", "tripod", "lateral"):
        if edges and rng.random() < (1.0 if kind == "lateral" else 0.7):
            held = _edge(_drawn(edges, rng), rng)
        else:
            held = _opposite_points(shape, corners, rng)
        return None if held is None else _pinched(pinches[kind == "lateral"], held, kind, rng)
    return _on_surface(tables, corners, kind, rng)


def kinds_for(sites: Sequence[Site], narrowest_m: float) -> tuple[str, ...]:
    """Types of grasps worth trying, those that are tried more often more than once.

    What is `narrowest_m` wide at its narrowest is pressed between two hands if it is too wide for one.
    """
    if narrowest_m > WIDEST_HELD_M:
        return ("press",)
    held = {site.kind for site in sites}
    kinds: list[str] = ["palm", "palm", "palm", "above", "above", "pinch", "pinch", "tripod", "tripod", "flat"]
    if "bar" in held:
        kinds += ["bar"] * 10 + ["hook"] * 8
    if "stick" in held:
        kinds += ["bar"] * 10 + ["tripod"] * 2
    if "rim" in held:
        kinds += ["pinch", "tripod", "lateral"] * 2
    if "knob" in held:
        kinds += ["tripod", "pinch", "above"] * 4
    return tuple(kinds)


def _around(tables: Tables, site: Site, kind: str, rng: Generator) -> Proposal:
    """Fingers around a bar: in a fist against the palm, or hooked around it with the palm away."""
    hand = tables.hand
    knuckle, palm = hand.offsets[8], hand.radii[1]
    along = site.along * (1.0 if rng.random() < 0.5 else -1.0)
    out = site.out
    if site.kind == "stick":
        out = _rotated(out, along, rng.uniform(0.0, 2.0 * np.pi))
    x, z = np.cross(along, out), out
    hooked = kind == "hook"
    swing = np.radians(rng.uniform(45.0, 105.0) if hooked else rng.uniform(-35.0, 50.0))
    if site.kind == "stick":
        swing = 0.0
    x, z = x * np.cos(swing) - z * np.sin(swing), z * np.cos(swing) + x * np.sin(swing)
    slant = np.radians(
        rng.normal(4.0 if hooked else 14.0, 8.0)
    )  # the bar runs from the index finger to the heel of the hand
    x, y = x * np.cos(slant) + along * np.sin(slant), along * np.cos(slant) - x * np.sin(slant)
    turn = _near(np.stack([x, y, z], axis=1), 0.10, rng)
    if hooked:
        at = [knuckle[0] + rng.uniform(0.012, 0.045), 0.0, knuckle[2] - 0.009 - site.radius - rng.uniform(0.0, 0.004)]
    else:
        at = [
            knuckle[0] + rng.uniform(-0.028, 0.012),
            0.0,
            knuckle[2] - palm - site.radius - rng.uniform(-0.002, 0.006),
        ]
    at[1] = rng.uniform(-0.028, 0.012)
    place = site.point - turn @ np.array(at)
    thumb = _POWER if not hooked or rng.random() < 0.5 else (0.0, 0.5, 0.8)
    wanted = np.array([thumb, *[_HOOK if hooked else _POWER] * 4])
    upright = hooked or (site.kind == "bar" and rng.random() < 0.7)
    down = turn[:, 0] if hooked else np.array([0.0, -1.0, 0.0])
    near = rng.uniform(0.0, _FARTHEST_M)
    return Proposal(kind, turn, place, wanted, (1, 2), -turn[:, 2], cone(down) if upright else SIDES, near)


def _pinched(pinches: Pinches, held: tuple[Array, Array, Array, float], kind: str, rng: Generator) -> Proposal | None:
    """The tips of thumb and finger, or three fingers, on two opposite places."""
    middle, line, toward, width = held
    fitting = np.flatnonzero(np.abs(pinches.widths - width) < 0.004)
    if not len(fitting):
        return None
    k = int(rng.choice(fitting))
    line = line * (1.0 if rng.random() < 0.5 else -1.0)
    toward = toward + 0.3 * rng.normal(size=3)
    frame = _frames(toward[None], line[None])[0]
    turn = frame @ pinches.frames[k].T
    if kind == "tripod":  # the middle finger presses beside the index finger
        turn = turn @ _rotation_about(pinches.frames[k][:, 0], rng.normal(0.0, 0.1))
    place = middle - turn @ pinches.middles[k]
    wanted = np.zeros((5, 3))
    wanted[0], wanted[1] = _PRECISE, (0.3, 2.0, 0.6) if kind == "lateral" else _PRECISE
    if kind == "tripod":
        wanted[2] = _PRECISE
        if rng.random() < 0.4:
            wanted[3:] = _PRECISE
    needed = (0, 1, 2) if kind == "tripod" else (0, 1)
    return Proposal(kind, turn, place, wanted, needed, frame[:, 0], SIDES)


def _on_surface(tables: Tables, corners: Array, kind: str, rng: Generator) -> Proposal:
    """The palm on or above the surface: closing around a body, or with all tips around it."""
    hand = tables.hand
    point, normal = _surface_point(corners, rng)
    z = normal + 0.25 * rng.normal(size=3)
    z /= np.linalg.norm(z)
    y = np.cross(z, rng.normal(size=3))
    y /= np.linalg.norm(y)
    turn = np.stack([np.cross(y, z), y, z], axis=1)
    knuckle, palm = hand.offsets[8], hand.radii[1]
    off = {"above": rng.uniform(0.02, 0.05), "palm": rng.uniform(-0.001, 0.012), "flat": rng.uniform(-0.001, 0.002)}[
        kind
    ]
    reach = rng.uniform(0.065, 0.1) + (0.025 if kind == "above" else 0.0)
    at = np.array([reach, rng.uniform(-0.02, 0.015), knuckle[2] - palm - off])
    row = {"above": _PRECISE, "palm": _POWER, "flat": _FLAT}[kind]
    wanted = np.array([row] * 5) * (1.0 if kind != "flat" else np.array([0.3, 1, 1, 1, 1])[:, None])
    flat = kind == "flat"
    downs = cone(turn[:, 2]) if flat else SIDES
    near = np.inf if flat else rng.uniform(0.0, _FARTHEST_M)
    return Proposal(kind, turn, point - turn @ at, wanted, () if flat else (0, 1, 2), -z, downs, near)


def cone(down: Array) -> Array:
    """The direction `down (3,)` and four that lean away from it by `CONE_RAD`, `(5, 3)`."""
    down = down / np.linalg.norm(down)
    u = np.cross(down, np.eye(3)[int(np.argmin(np.abs(down)))])
    u /= np.linalg.norm(u)
    v = np.cross(down, u)
    aside = np.sin(CONE_RAD) * np.array([u, -u, v, -v])
    return np.concatenate([down[None], np.cos(CONE_RAD) * down + aside])


def _pressed(tables: Tables, shape: Surface, corners: Array, rng: Generator) -> Proposal | None:
    """A flat hand against a side of the object, with fingers forward and down; another hand presses against it."""
    aside = rng.uniform(0.0, 2.0 * np.pi)
    out = np.array([np.cos(aside), 0.0, np.sin(aside)])
    start = shape.center_of_mass + 0.6 * out + rng.normal(0.0, [0.03, 0.02, 0.03])
    reach = float(shape.trace(start[None], -out[None])[0])
    if not reach < 0.6:
        return None
    point = start - reach * out
    normal = shape.signed_distance(point[None])[1][0]
    if normal @ out < 0.9:
        return None
    fingers = _rotated(np.array([0.0, -1.0, 0.0]), normal, rng.uniform(-2.2, 2.2))
    frame = _frames(normal[None] + 0.05 * rng.normal(size=3), fingers[None])[0]
    x, z = frame[:, 1], frame[:, 0]
    turn = np.stack([x, np.cross(z, x), z], axis=1)
    off = tables.hand.radii[1] + rng.uniform(0.0, 0.004)
    at = np.array([rng.uniform(0.07, 0.11), rng.uniform(-0.015, 0.015), tables.hand.offsets[8, 2] - off])
    wanted = np.array([_FLAT] * 5)
    return Proposal("press", turn, point - turn @ at, wanted, (1, 2), -z, np.empty((0, 3)))


def _edge(site: Site, rng: Generator) -> tuple[Array, Array, Array, float]:
    """Two opposite places on a thin part: their middle, the line between them, the way toward it and their distance."""
    if site.kind == "rim":
        line = np.cross(site.out, site.along)
        return site.point - site.out * rng.uniform(0.002, 0.014), line, -site.out, 2.0 * site.radius
    line = _rotated(
        site.out if site.kind == "stick" else site.along,
        site.along if site.kind == "stick" else site.out,
        rng.uniform(0, 2 * np.pi),
    )
    toward = -site.out if site.kind == "knob" else _rotated(site.along, line, rng.uniform(0.0, 2.0 * np.pi))
    return site.point, line, toward, 2.0 * site.radius


def _opposite_points(shape: Surface, corners: Array, rng: Generator) -> tuple[Array, Array, Array, float] | None:
    """Two places on the surface that look away from each other."""
    point, normal = _surface_point(corners, rng)
    inward = -normal + 0.1 * rng.normal(size=3)
    inward /= np.linalg.norm(inward)
    width = float(shape.trace((point + 1e-4 * inward)[None], inward[None])[0])
    if not width < WIDEST_PINCH_M:
        return None
    outward = shape.signed_distance((point + (width + 1e-4) * inward)[None])[1][0]
    if outward @ inward < 0.8:
        return None
    middle = point + 0.5 * width * inward
    centre = shape.center_of_mass - middle
    toward = np.cross(inward, rng.normal(size=3)) + 4.0 * (centre - inward * (centre @ inward))
    return middle, inward, toward, width


def _surface_point(corners: Array, rng: Generator) -> tuple[Array, Array]:
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1)
    face = int(np.searchsorted(np.cumsum(area), rng.random() * area.sum()))
    face = min(face, len(area) - 1)
    u, v = np.sqrt(rng.random()), rng.random()
    point = np.array([1.0 - u, u * (1.0 - v), u * v]) @ corners[face]
    return point, cross[face] / max(area[face], 1e-15)


def _frames(along: Array, line: Array) -> Array:
    """Orthonormal frames `(n, 3, 3)` with `line (n, 3)` as second column and the first near `along (n, 3)`."""
    line = line / np.linalg.norm(line, axis=1, keepdims=True)
    along = along - line * np.sum(along * line, axis=1, keepdims=True)
    along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    return np.stack([along, line, np.cross(along, line)], axis=2)


def _near(turn: Array, spread: float, rng: Generator) -> Array:
    axis = rng.normal(0.0, spread, 3)
    angle = float(np.linalg.norm(axis))
    return turn @ _rotation_about(axis / max(angle, 1e-9), angle)


def _rotation_about(axis: Array, angle: float) -> Array:
    x, y, z = axis
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * skew + (1.0 - np.cos(angle)) * (skew @ skew)


def _rotated(vector: Array, axis: Array, angle: float) -> Array:
    return _rotation_about(axis, angle) @ vector


def _drawn(sites: Sequence[Site], rng: Generator) -> Site:
    return sites[int(rng.integers(len(sites)))]
