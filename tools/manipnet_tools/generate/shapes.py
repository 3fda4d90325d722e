"""Objects to be held, made by rule and chance: each number and seed gives one, always the same.

Sizes follow everyday things whose grips are 2 to 12 cm wide. None is taken from a scanned or captured object.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import trimesh
from numpy.random import Generator
from numpy.typing import NDArray

from manipnet.geometry import Array
from manipnet.synthesis.objects.mesh import ClosedMesh, closed_mesh
from manipnet_tools.assets.objects import curve, turns
from manipnet_tools.generate.solids import Site, Solid, box, convex, tube, turned, union

TRIES: Final = 20
_X, _Y, _Z = np.eye(3)


@dataclass(frozen=True, eq=False)
class MadeShape:
    """A closed mesh in metres, the points `(n, 3)` of its convex pieces, and where it may be held."""

    kind: str
    mesh: ClosedMesh
    pieces: tuple[Array, ...]
    sites: tuple[Site, ...]


def make_shape(number: int, seed: int) -> MadeShape:
    """The shape of a number."""
    names = list(KINDS)
    shares = np.array([share for share, _ in KINDS.values()], dtype=float)
    order = (number * 0.6180339887 + 0.37 * seed) % 1.0
    kind = names[int(np.searchsorted(np.cumsum(shares) / shares.sum(), order, side="right"))]
    for turn in range(TRIES):
        rng = np.random.default_rng([seed, number, turn])
        try:
            made = _in_metres(kind, KINDS[kind][1](rng), f"{kind}-{number:04d}", rng)
        except (ValueError, IndexError):
            continue
        if made is not None:
            return made
    raise AssertionError(f"no {kind} of number {number} and seed {seed} is closed")


def _in_metres(kind: str, solid: Solid, name: str, rng: Generator) -> MadeShape | None:
    """The solid in metres, as many objects are tracked: about its own middle or another point."""
    if not solid.mesh.is_watertight or solid.mesh.volume <= 0.0:
        return None
    centre = 0.5 * solid.mesh.bounds.sum(axis=0) * rng.uniform(0.0, 1.2) + rng.normal(0.0, 8.0, 3)
    mesh = closed_mesh(1e-3 * (solid.mesh.vertices - centre), np.asarray(solid.mesh.faces), name)
    pieces = tuple(1e-3 * (piece - centre) for piece in solid.pieces)
    sites = tuple(Site(s.kind, 1e-3 * (s.point - centre), s.along, s.out, 1e-3 * s.radius) for s in solid.sites)
    return MadeShape(kind, mesh, pieces, sites)


def _blocks(rng: Generator) -> Solid:
    size = np.exp(rng.uniform(np.log(18), np.log(120), 3))
    size[rng.integers(3)] = rng.uniform(20, 80)
    return box(size)


def _prism(rng: Generator) -> Solid:
    corners = rng.uniform(18, 42) * turns(int(rng.integers(3, 8))) * rng.uniform(0.6, 1.0, 2)
    half = 0.5 * rng.uniform(35, 150)
    taper = rng.uniform(0.6, 1.0)
    return convex(np.array([(s * x, y, s * z) for x, z in corners for y, s in ((-half, 1.0), (half, taper))]))


def _superquadric(rng: Generator) -> Solid:
    ball = trimesh.creation.icosphere(4, 1.0)
    e, a = rng.uniform(0.35, 1.3, 2)
    polar, azimuth = (
        np.arcsin(np.clip(ball.vertices[:, 1], -1, 1)),
        np.arctan2(ball.vertices[:, 2], ball.vertices[:, 0]),
    )

    def power(x: Array, p: float) -> Array:
        return np.sign(x) * np.abs(x) ** p

    flat = power(np.cos(polar), e)
    points = np.stack([flat * power(np.cos(azimuth), a), power(np.sin(polar), e), flat * power(np.sin(azimuth), a)], 1)
    ball.vertices = points * rng.uniform(17, 55, 3)
    return Solid(ball, (np.asarray(trimesh.convex.convex_hull(ball.vertices).vertices),))


def _rod(rng: Generator) -> Solid:
    radius, length = rng.uniform(4, 18), rng.uniform(70, 240)
    solid = turned(np.array([(radius, -length / 2), (radius * rng.uniform(0.7, 1.2), length / 2)]), corner=0.3 * radius)
    return _held(solid, _sticks(rng, -0.35 * length, 0.35 * length, radius, 5))


def _plate(rng: Generator) -> Solid:
    thick = rng.uniform(4, 14)
    if rng.random() < 0.5:
        radius = rng.uniform(45, 100)
        solid = turned(np.array([(radius, -thick / 2), (radius, thick / 2)]), corner=0.35 * thick)
        return _held(solid, _rims(rng, radius - 0.4 * thick, 0.0, thick / 2, 6, outward=True))
    size = np.array([rng.uniform(60, 180), thick, rng.uniform(50, 110)])
    sites = []
    for axis in (0, 2):
        for sign in (-1.0, 1.0):
            point = np.zeros(3)
            point[axis], point[2 - axis] = sign * (0.5 * size[axis] - 3), rng.uniform(-0.25, 0.25) * size[2 - axis]
            sites.append(Site("rim", point, np.eye(3)[2 - axis], sign * np.eye(3)[axis], thick / 2))
    return _held(box(size), sites)


def _torus(rng: Generator) -> Solid:
    ring, radius = rng.uniform(28, 65), rng.uniform(5, 15)
    count = 36
    path = ring * np.stack([turns(count)[:, 0], np.zeros(count), turns(count)[:, 1]], axis=1)
    flat = rng.uniform(0.7, 1.5)
    solid = tube(path, np.full(count, 2 * radius), np.full(count, 2 * radius * flat), _Y, closed=True)
    sites = []
    for angle in rng.uniform(0, 2 * np.pi, 6):
        out = np.array([np.cos(angle), 0.0, np.sin(angle)])
        sites.append(Site("bar", ring * out, np.cross(_Y, out), out, radius))
    return _held(solid, sites)


def _extrusion(rng: Generator) -> Solid:
    """A letter made of two or three blocks."""
    depth, arm = rng.uniform(18, 45), rng.uniform(18, 32)
    tall, wide = rng.uniform(70, 140), rng.uniform(50, 110)
    stem = box((arm, tall, depth))
    beam = box((wide, arm, depth)).moved(
        _shift(_X * rng.uniform(0.0, 0.4) * wide + _Y * rng.choice([-0.5, 0.0, 0.5]) * (tall - arm))
    )
    return _held(union([stem, beam]), [Site("stick", np.zeros(3), _Y, _X, arm / 2)])


def _bottle(rng: Generator) -> Solid:
    radius, height = rng.uniform(18, 44), rng.uniform(100, 240)
    neck, shoulder = rng.uniform(0.28, 0.6) * radius, rng.uniform(0.1, 0.28) * height
    waist = rng.uniform(0.85, 1.0) * radius
    line = curve(
        [
            (radius, -height / 2),
            (waist, -0.2 * height),
            (radius, shoulder),
            (neck, shoulder + 0.16 * height),
            (neck, height / 2),
        ],
        20,
    )
    sites = [
        *_sticks(rng, -0.3 * height, 0.6 * shoulder, waist, 4),
        *_sticks(rng, 0.4 * height, 0.45 * height, neck, 1),
    ]
    return _held(turned(line, corner=2.0), sites)


def _vase(rng: Generator) -> Solid:
    height = rng.uniform(40, 170)
    radii = rng.uniform(16, 48, 5)
    line = curve(list(zip(radii, np.linspace(-height / 2, height / 2, 5), strict=True)), 18)
    return _held(turned(line), _sticks(rng, -0.3 * height, 0.3 * height, float(radii.mean()), 2))


def _goblet(rng: Generator) -> Solid:
    height, bowl = rng.uniform(100, 210), rng.uniform(26, 46)
    stem, foot, knee = rng.uniform(3.5, 8), rng.uniform(26, 40), rng.uniform(-0.15, 0.1) * height
    line = curve(
        [(0.4 * foot, 4 - height / 2), (stem, 15 - height / 2), (stem, knee - 12), (0.7 * bowl, knee + 10),
         (bowl, knee + 0.25 * height), (bowl * rng.uniform(0.75, 1.1), height / 2)], 22,
    )  # fmt: skip
    line = np.vstack([(foot, -height / 2), (foot, 3 - height / 2), line])
    sites = _sticks(rng, 18 - height / 2, knee - 10, stem, 4)
    sites += [
        Site(s.kind, s.point + _Y * (knee + 0.22 * height), s.along, s.out, bowl) for s in _sticks(rng, 0, 1, bowl, 3)
    ]
    return _held(turned(line, corner=1.0), sites)


def _vessel(rng: Generator, radius: float, height: float, hollow: bool, wall: float) -> tuple[Solid, NDArray]:
    """A cup, and its outside line."""
    foot, middle, lip = (
        radius * rng.uniform(0.7, 1.0),
        radius * rng.uniform(0.92, 1.08),
        radius * rng.uniform(0.85, 1.0),
    )
    outer = curve([(foot, -height / 2), (middle, 0.0), (lip, height / 2)], 10)
    if not hollow:
        return turned(outer, corner=2.0), outer
    cavity = outer[1:].copy() - [wall, 0.0]
    floor = -height / 2 + wall
    cavity = np.vstack([(0.0, floor), (max(cavity[0, 0], 5.0), floor), cavity[cavity[:, 1] > floor + 1.0]])
    return turned(outer, cavity, corner=1.2), outer


def _cup(rng: Generator) -> Solid:
    radius, height, wall = rng.uniform(26, 45), rng.uniform(50, 120), rng.uniform(3, 6)
    solid, outer = _vessel(rng, radius, height, rng.random() < 0.7, wall)
    lip = outer[-1, 0] - wall / 2
    return _held(
        solid, [*_sticks(rng, -0.3 * height, 0.3 * height, radius, 4), *_rims(rng, lip, height / 2, wall / 2, 2)]
    )


def _bowl(rng: Generator) -> Solid:
    radius, height, wall = rng.uniform(40, 85), rng.uniform(30, 70), rng.uniform(3, 6)
    foot = rng.uniform(0.35, 0.7) * radius
    outer = curve([(foot, -height / 2), (foot + 0.65 * (radius - foot), -0.15 * height), (radius, height / 2)], 10)
    inner = outer[2:] - [wall, 0.0]
    inner = np.vstack([(0.0, inner[0, 1]), inner])
    return _held(turned(outer, inner, corner=1.2), _rims(rng, radius - wall / 2, height / 2 - 4, wall / 2, 6))


def _handle(rng: Generator, outer: NDArray, low: float, high: float, gap: tuple[float, float] = (24, 42)) -> Solid:
    """A side handle between two heights of a vessel, at +x: round, square, ear-shaped, flat or an open hook."""
    r0, r1 = np.interp([low, high], outer[:, 1], outer[:, 0])
    out, middle, tall = max(r0, r1) + rng.uniform(*gap), 0.5 * (low + high), high - low
    form = rng.choice(["round", "square", "ear", "hook", "straight"], p=[0.3, 0.25, 0.2, 0.1, 0.15])
    bulge = {"round": 0.55, "square": 0.9, "ear": 0.5, "hook": 0.85, "straight": 0.95}[form]
    top, bottom = middle + 0.5 * bulge * tall, middle - 0.5 * bulge * tall
    knots = [
        (r1 - 5, high),
        (0.5 * (r1 + out), high + (2 if form != "straight" else 0)),
        (out, top),
        (out, middle),
        (out, bottom),
    ]
    knots += [] if form == "hook" else [(0.5 * (r0 + out), low), (r0 - 5, low)]
    if form == "ear":
        knots[2], knots[4] = (out + 4, top + 4), (out - 0.3 * (out - r0), bottom)
    line = _smooth_path(np.array(knots), 24)
    thick, width = rng.uniform(6, 14), rng.uniform(7, 20)
    path = np.c_[line, np.zeros(len(line))]
    taper = 1.0 + rng.uniform(-0.15, 0.25) * np.sin(np.linspace(0, np.pi, len(line)))
    solid = tube(path, thick * taper, width * taper, _Z)
    sites = []
    for height in np.linspace(bottom + 0.15 * tall * bulge, top - 0.15 * tall * bulge, 4):
        k = int(np.argmin(np.abs(line[:, 1] - height) + (line[:, 0] < 0.6 * out + 0.4 * r1) * 1e3))
        tangent = np.gradient(path, axis=0)[k]
        tangent /= np.linalg.norm(tangent)
        tangent *= np.sign(tangent[1]) or 1.0
        sites.append(Site("bar", path[k], tangent, np.cross(tangent, _Z), 0.25 * (thick + width)))
    return _held(solid, sites)


def _mug(rng: Generator) -> Solid:
    radius, height, wall = rng.uniform(28, 46), rng.uniform(55, 125), rng.uniform(3, 6)
    body, outer = _vessel(rng, radius, height, rng.random() < 0.75, wall)
    tall = rng.uniform(0.5, 0.85) * height
    middle = rng.uniform(-0.06, 0.06) * height
    handle = _handle(rng, outer, max(middle - tall / 2, 9 - height / 2), min(middle + tall / 2, height / 2 - 9))
    return _joined(
        body, handle, hollow_to=outer, wall=wall, extra=_rims(rng, outer[-1, 0] - wall / 2, height / 2, wall / 2, 1)
    )


def _jug(rng: Generator) -> Solid:
    radius, height, wall = rng.uniform(38, 62), rng.uniform(110, 200), rng.uniform(4, 7)
    body, outer = _vessel(rng, radius, height, False, wall)
    tall = rng.uniform(0.45, 0.75) * height
    middle = rng.uniform(0.0, 0.1) * height
    handle = _handle(rng, outer, middle - tall / 2, min(middle + tall / 2, height / 2 - 9), (30, 48))
    parts = [body, handle]
    if rng.random() < 0.6:
        reach = np.interp(-0.1 * height, outer[:, 1], outer[:, 0])
        line = curve([(-reach + 6, -0.15 * height), (-reach - 20, 0.05 * height), (-reach - 32, 0.3 * height)], 9)
        size = rng.uniform(11, 20)
        parts.append(
            tube(np.c_[line, np.zeros(9)], np.linspace(size, 0.7 * size, 9), np.linspace(size, 0.7 * size, 9), _Z)
        )
    return union(parts)


def _kettle(rng: Generator) -> Solid:
    """A body with a handle above it."""
    radius, height = rng.uniform(38, 62), rng.uniform(50, 95)
    body, outer = _vessel(rng, radius, height, False, 5.0)
    return union([body, _top_handle(rng, 0.75 * outer[-1, 0], height / 2)])


def _case(rng: Generator) -> Solid:
    size = np.array([rng.uniform(80, 170), rng.uniform(45, 110), rng.uniform(28, 60)])
    return union([box(size), _top_handle(rng, rng.uniform(0.28, 0.4) * size[0], size[1] / 2)])


def _top_handle(rng: Generator, half: float, top: float) -> Solid:
    half = max(half, 32.0)
    rise, thick, width = rng.uniform(34, 52), rng.uniform(8, 13), rng.uniform(10, 18)
    square = rng.uniform(0.55, 0.95)
    knots = [
        (half, top - 4),
        (half, top + 0.6 * rise),
        (square * half, top + rise),
        (0, top + rise * rng.uniform(1.0, 1.15)),
    ]
    knots += [(-x, y) for x, y in knots[-2::-1]]
    line = _smooth_path(np.array(knots), 28)
    path = np.c_[line, np.zeros(28)]
    solid = tube(path, np.full(28, thick), np.full(28, width), _Z)
    sites = [Site("bar", path[k], _X, _Y, 0.25 * (thick + width)) for k in (11, 13, 14, 16)]
    return _held(solid, sites)


def _grip(rng: Generator) -> tuple[Solid, float]:
    """A handle to be held like that of a tool, from the origin up; and its length."""
    length, mean = rng.uniform(95, 165), rng.uniform(9, 17)
    radii = mean * (1 + rng.uniform(-0.15, 0.15, 5))
    solid = turned(curve(list(zip(radii, np.linspace(0, length, 5), strict=True)), 12), corner=2.5)
    flat = np.array([1.0, 1.0, rng.uniform(0.65, 1.25)])
    return _held(solid.scaled(flat), _sticks(rng, 0.25 * length, 0.75 * length, mean, 6)), length


def _pan(rng: Generator) -> Solid:
    grip, length = _grip(rng)
    radius, depth, wall = rng.uniform(38, 75), rng.uniform(14, 50), rng.uniform(3, 5)
    outer = np.array([(0.85 * radius, 0.0), (radius, depth)])
    inner = np.array([(0.0, wall), (0.85 * radius - wall, wall), (radius - wall, depth)])
    dish = turned(outer, inner, corner=1.2).moved(_rotation(_Z, np.pi / 2))
    dish = dish.moved(_rotation(_Y, rng.uniform(0, 2 * np.pi))).moved(_shift(_Y * (length + 0.93 * radius)))
    return union([grip, dish])


def _tool(rng: Generator) -> Solid:
    grip, length = _grip(rng)
    head = rng.integers(4)
    if head == 0:
        part = box((rng.uniform(18, 30), rng.uniform(20, 35), rng.uniform(60, 110))).moved(_shift(_Y * (length + 8)))
    elif head == 1:
        radius = rng.uniform(3, 6)
        part = turned(np.array([(radius, length - 8), (radius, length + rng.uniform(50, 110))]), corner=1.0)
    elif head == 2:
        ball = trimesh.creation.icosphere(3, rng.uniform(18, 34))
        part = Solid(ball, (np.asarray(ball.vertices),)).moved(_shift(_Y * (length + 14)))
    else:
        part = box((rng.uniform(5, 10), rng.uniform(70, 110), rng.uniform(22, 45))).moved(_shift(_Y * (length + 30)))
    return union([grip, part])


def _lid(rng: Generator) -> Solid:
    """A flat lid with a knob or a bow to hold it by."""
    radius, thick = rng.uniform(40, 80), rng.uniform(5, 9)
    disc = turned(np.array([(radius, 0.0), (radius * rng.uniform(0.8, 1.0), thick)]))
    if rng.random() < 0.3:
        return union([disc, _top_handle(rng, 34.0, thick)])
    knob, neck, rise = rng.uniform(9, 19), rng.uniform(0.35, 0.7), rng.uniform(18, 34)
    line = curve(
        [
            (knob * neck, thick - 3),
            (knob * neck, thick + 0.35 * rise),
            (knob, thick + 0.75 * rise),
            (0.7 * knob, thick + rise),
        ],
        10,
    )
    site = Site("knob", _Y * (thick + 0.72 * rise), _X, _Y, knob)
    return union([disc, _held(turned(line), [site, site, site])])


def _pair(rng: Generator) -> Solid:
    """Two simple bodies that overlap."""
    first, second = (_SIMPLE[int(rng.integers(len(_SIMPLE)))](rng) for _ in range(2))
    reach = 0.5 * first.mesh.extents * rng.uniform(0.3, 0.9, 3) * np.sign(rng.normal(size=3)) * (rng.random(3) < 0.6)
    return union([first, second.moved(_rotation(_X, rng.uniform(0, np.pi))).moved(_shift(reach))])


def _joined(body: Solid, handle: Solid, hollow_to: NDArray, wall: float, extra: list[Site]) -> Solid:
    """A vessel with its handle, whose ends end inside the wall and not in the cavity."""
    inner = handle.mesh.vertices
    reach = np.hypot(inner[:, 0], inner[:, 2])
    allowed = np.interp(inner[:, 1], hollow_to[:, 1], hollow_to[:, 0]) - 0.6 * wall
    share = np.maximum(allowed / np.maximum(reach, 1e-6), 1.0)
    mesh = handle.mesh.copy()
    mesh.vertices = inner * np.c_[share, np.ones(len(share)), share]
    return _held(union([body, Solid(mesh, handle.pieces, handle.sites)]), extra)


def _sticks(rng: Generator, low: float, high: float, radius: float, count: int) -> list[Site]:
    """Places on a stick along Y."""
    angles, heights = rng.uniform(0, 2 * np.pi, count), rng.uniform(min(low, high), max(low, high), count)
    return [
        Site("stick", _Y * height, _Y, np.array([np.cos(angle), 0.0, np.sin(angle)]), radius)
        for angle, height in zip(angles, heights, strict=True)
    ]


def _rims(rng: Generator, radius: float, height: float, half: float, count: int, outward: bool = False) -> list[Site]:
    """Places on a round rim, held from above or, if `outward`, from aside."""
    sites = []
    for angle in rng.uniform(0, 2 * np.pi, count):
        out = np.array([np.cos(angle), 0.0, np.sin(angle)])
        sites.append(Site("rim", radius * out + height * _Y, np.cross(_Y, out), out if outward else _Y, half))
    return sites


def _smooth_path(knots: NDArray, count: int) -> NDArray:
    """Points `(count, 2)` on a smooth line near the knots; its ends are the first and the last."""
    for _ in range(4):
        inside = np.stack([0.75 * knots[:-1] + 0.25 * knots[1:], 0.25 * knots[:-1] + 0.75 * knots[1:]], axis=1)
        knots = np.vstack([knots[:1], inside.reshape(-1, 2)[1:-1], knots[-1:]])
    along = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(knots, axis=0), axis=1))]
    at = np.linspace(0.0, along[-1], count)
    return np.stack([np.interp(at, along, knots[:, 0]), np.interp(at, along, knots[:, 1])], axis=1)


def _held(solid: Solid, sites: list[Site]) -> Solid:
    return Solid(solid.mesh, solid.pieces, (*solid.sites, *sites))


def _shift(by: Array) -> Array:
    return trimesh.transformations.translation_matrix(by)


def _rotation(axis: Array, angle: float) -> Array:
    return trimesh.transformations.rotation_matrix(angle, axis)


_SIMPLE: Final = (_blocks, _prism, _superquadric, _vase)
KINDS: Final[dict[str, tuple[float, Callable[[Generator], Solid]]]] = {
    "mug": (15, _mug), "jug": (9, _jug), "kettle": (4, _kettle), "case": (4, _case), "pan": (6, _pan),
    "tool": (7, _tool), "lid": (5, _lid), "goblet": (5, _goblet), "cup": (6, _cup), "bowl": (4, _bowl),
    "bottle": (6, _bottle), "vase": (5, _vase), "rod": (4, _rod), "plate": (4, _plate), "torus": (3, _torus),
    "box": (4, _blocks), "prism": (3, _prism), "superquadric": (4, _superquadric), "letter": (3, _extrusion),
    "pair": (3, _pair),
}  # fmt: skip
"""Kinds of shapes, how often each is made, and how."""
