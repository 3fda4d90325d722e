"""Cups, bowls and whatever has a handle of one of many forms. Millimetres, Y up.

Each function that takes only a generator draws one object; an equal generator gives an equal one.
"""

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from manipnet_tools.assets.objects import curve
from manipnet_tools.generate.placing import rims, sticks, with_sites
from manipnet_tools.generate.solids import Site, Solid, box, tube, turned, union

_X, _Y, _Z = np.eye(3)


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


def cup(rng: Generator) -> Solid:
    radius, height, wall = rng.uniform(26, 45), rng.uniform(50, 120), rng.uniform(3, 6)
    solid, outer = _vessel(rng, radius, height, rng.random() < 0.7, wall)
    lip = outer[-1, 0] - wall / 2
    return with_sites(
        solid, [*sticks(rng, -0.3 * height, 0.3 * height, radius, 4), *rims(rng, lip, height / 2, wall / 2, 2)]
    )


def bowl(rng: Generator) -> Solid:
    radius, height, wall = rng.uniform(40, 85), rng.uniform(30, 70), rng.uniform(3, 6)
    foot = rng.uniform(0.35, 0.7) * radius
    outer = curve([(foot, -height / 2), (foot + 0.65 * (radius - foot), -0.15 * height), (radius, height / 2)], 10)
    inner = outer[2:] - [wall, 0.0]
    inner = np.vstack([(0.0, inner[0, 1]), inner])
    return with_sites(turned(outer, inner, corner=1.2), rims(rng, radius - wall / 2, height / 2 - 4, wall / 2, 6))


def _side_handle(rng: Generator, outer: NDArray, low: float, high: float, gap: tuple[float, float] = (24, 42)) -> Solid:
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
        sites.append(
            Site("bar", path[k], tangent, np.cross(tangent, np.array([0.0, 0.0, 1.0])), 0.25 * (thick + width))
        )
    return with_sites(solid, sites)


def mug(rng: Generator) -> Solid:
    radius, height, wall = rng.uniform(28, 46), rng.uniform(55, 125), rng.uniform(3, 6)
    body, outer = _vessel(rng, radius, height, rng.random() < 0.75, wall)
    tall = rng.uniform(0.5, 0.85) * height
    middle = rng.uniform(-0.06, 0.06) * height
    handle = _side_handle(rng, outer, max(middle - tall / 2, 9 - height / 2), min(middle + tall / 2, height / 2 - 9))
    return _joined(
        body, handle, hollow_to=outer, wall=wall, extra=rims(rng, outer[-1, 0] - wall / 2, height / 2, wall / 2, 1)
    )


def jug(rng: Generator) -> Solid:
    radius, height, wall = rng.uniform(38, 62), rng.uniform(110, 200), rng.uniform(4, 7)
    body, outer = _vessel(rng, radius, height, False, wall)
    tall = rng.uniform(0.45, 0.75) * height
    middle = rng.uniform(0.0, 0.1) * height
    handle = _side_handle(rng, outer, middle - tall / 2, min(middle + tall / 2, height / 2 - 9), (30, 48))
    parts = [body, handle]
    if rng.random() < 0.6:
        reach = np.interp(-0.1 * height, outer[:, 1], outer[:, 0])
        line = curve([(-reach + 6, -0.15 * height), (-reach - 20, 0.05 * height), (-reach - 32, 0.3 * height)], 9)
        size = rng.uniform(11, 20)
        parts.append(
            tube(np.c_[line, np.zeros(9)], np.linspace(size, 0.7 * size, 9), np.linspace(size, 0.7 * size, 9), _Z)
        )
    return union(parts)


def kettle(rng: Generator) -> Solid:
    """A body with a handle above it."""
    radius, height = rng.uniform(38, 62), rng.uniform(50, 95)
    body, outer = _vessel(rng, radius, height, False, 5.0)
    return union([body, top_handle(rng, 0.75 * outer[-1, 0], height / 2)])


def case(rng: Generator) -> Solid:
    size = np.array([rng.uniform(80, 170), rng.uniform(45, 110), rng.uniform(28, 60)])
    return union([box(size), top_handle(rng, rng.uniform(0.28, 0.4) * size[0], size[1] / 2)])


def top_handle(rng: Generator, half: float, top: float) -> Solid:
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
    return with_sites(solid, sites)


def _joined(body: Solid, handle: Solid, hollow_to: NDArray, wall: float, extra: list[Site]) -> Solid:
    """A vessel with its handle, whose ends end inside the wall and not in the cavity."""
    inner = handle.mesh.vertices
    reach = np.hypot(inner[:, 0], inner[:, 2])
    allowed = np.interp(inner[:, 1], hollow_to[:, 1], hollow_to[:, 0]) - 0.6 * wall
    share = np.maximum(allowed / np.maximum(reach, 1e-6), 1.0)
    mesh = handle.mesh.copy()
    mesh.vertices = inner * np.c_[share, np.ones(len(share)), share]
    return with_sites(union([body, Solid(mesh, handle.pieces, handle.sites)]), extra)


def _smooth_path(knots: NDArray, count: int) -> NDArray:
    """Points `(count, 2)` on a smooth line near the knots; its ends are the first and the last."""
    for _ in range(4):
        inside = np.stack([0.75 * knots[:-1] + 0.25 * knots[1:], 0.25 * knots[:-1] + 0.75 * knots[1:]], axis=1)
        knots = np.vstack([knots[:1], inside.reshape(-1, 2)[1:-1], knots[-1:]])
    along = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(knots, axis=0), axis=1))]
    at = np.linspace(0.0, along[-1], count)
    return np.stack([np.interp(at, along, knots[:, 0]), np.interp(at, along, knots[:, 1])], axis=1)
