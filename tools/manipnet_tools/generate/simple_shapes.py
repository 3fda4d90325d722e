"""Objects without a cavity: bodies, rods, plates, bottles, glasses, and tools with grips. Millimetres, Y up.

Each function draws one; an equal generator gives an equal one.
"""

import numpy as np
import trimesh
from numpy.random import Generator

from manipnet.geometry import Array
from manipnet_tools.assets.objects import curve, turns
from manipnet_tools.generate.placing import rims, rotated, shifted, sticks, with_sites
from manipnet_tools.generate.solids import Site, Solid, box, convex, tube, turned, union
from manipnet_tools.generate.vessels import top_handle

_X, _Y, _Z = np.eye(3)


def block(rng: Generator) -> Solid:
    size = np.exp(rng.uniform(np.log(18), np.log(120), 3))
    size[rng.integers(3)] = rng.uniform(20, 80)
    return box(size)


def crate(rng: Generator) -> Solid:
    """A box for two hands."""
    return box(rng.uniform([150, 140, 150], [260, 240, 260]))


def ball(rng: Generator) -> Solid:
    """A ball or an egg for two hands."""
    mesh = trimesh.creation.icosphere(4, 1.0)
    mesh.vertices *= rng.uniform(75, 130) * rng.uniform(0.9, 1.1, 3)
    return Solid(mesh, (np.asarray(trimesh.convex.convex_hull(mesh.vertices).vertices),))


def prism(rng: Generator) -> Solid:
    corners = rng.uniform(18, 42) * turns(int(rng.integers(3, 8))) * rng.uniform(0.6, 1.0, 2)
    half = 0.5 * rng.uniform(35, 150)
    taper = rng.uniform(0.6, 1.0)
    return convex(np.array([(s * x, y, s * z) for x, z in corners for y, s in ((-half, 1.0), (half, taper))]))


def superquadric(rng: Generator) -> Solid:
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


def rod(rng: Generator) -> Solid:
    radius, length = rng.uniform(4, 18), rng.uniform(70, 240)
    solid = turned(np.array([(radius, -length / 2), (radius * rng.uniform(0.7, 1.2), length / 2)]), corner=0.3 * radius)
    return with_sites(solid, sticks(rng, -0.35 * length, 0.35 * length, radius, 5))


def plate(rng: Generator) -> Solid:
    thick = rng.uniform(4, 14)
    if rng.random() < 0.5:
        radius = rng.uniform(45, 100)
        solid = turned(np.array([(radius, -thick / 2), (radius, thick / 2)]), corner=0.35 * thick)
        return with_sites(solid, rims(rng, radius - 0.4 * thick, 0.0, thick / 2, 6, outward=True))
    size = np.array([rng.uniform(60, 180), thick, rng.uniform(50, 110)])
    sites = []
    for axis in (0, 2):
        for sign in (-1.0, 1.0):
            point = np.zeros(3)
            point[axis], point[2 - axis] = sign * (0.5 * size[axis] - 3), rng.uniform(-0.25, 0.25) * size[2 - axis]
            sites.append(Site("rim", point, np.eye(3)[2 - axis], sign * np.eye(3)[axis], thick / 2))
    return with_sites(box(size), sites)


def torus(rng: Generator) -> Solid:
    ring, radius = rng.uniform(28, 65), rng.uniform(5, 15)
    count = 36
    path = ring * np.stack([turns(count)[:, 0], np.zeros(count), turns(count)[:, 1]], axis=1)
    flat = rng.uniform(0.7, 1.5)
    solid = tube(path, np.full(count, 2 * radius), np.full(count, 2 * radius * flat), _Y, closed=True)
    sites = []
    for angle in rng.uniform(0, 2 * np.pi, 6):
        out = np.array([np.cos(angle), 0.0, np.sin(angle)])
        sites.append(Site("bar", ring * out, np.cross(_Y, out), out, radius))
    return with_sites(solid, sites)


def letter(rng: Generator) -> Solid:
    """A letter made of two or three blocks."""
    depth, arm = rng.uniform(18, 45), rng.uniform(18, 32)
    tall, wide = rng.uniform(70, 140), rng.uniform(50, 110)
    stem = box((arm, tall, depth))
    beam = box((wide, arm, depth)).moved(
        shifted(_X * rng.uniform(0.0, 0.4) * wide + _Y * rng.choice([-0.5, 0.0, 0.5]) * (tall - arm))
    )
    return with_sites(union([stem, beam]), [Site("stick", np.zeros(3), _Y, _X, arm / 2)])


def bottle(rng: Generator) -> Solid:
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
        *sticks(rng, -0.3 * height, 0.6 * shoulder, waist, 4),
        *sticks(rng, 0.4 * height, 0.45 * height, neck, 1),
    ]
    return with_sites(turned(line, corner=2.0), sites)


def vase(rng: Generator) -> Solid:
    height = rng.uniform(40, 170)
    radii = rng.uniform(16, 48, 5)
    line = curve(list(zip(radii, np.linspace(-height / 2, height / 2, 5), strict=True)), 18)
    return with_sites(turned(line), sticks(rng, -0.3 * height, 0.3 * height, float(radii.mean()), 2))


def goblet(rng: Generator) -> Solid:
    height, bowl = rng.uniform(100, 210), rng.uniform(26, 46)
    stem, foot, knee = rng.uniform(3.5, 8), rng.uniform(26, 40), rng.uniform(-0.15, 0.1) * height
    line = curve(
        [(0.4 * foot, 4 - height / 2), (stem, 15 - height / 2), (stem, knee - 12), (0.7 * bowl, knee + 10),
         (bowl, knee + 0.25 * height), (bowl * rng.uniform(0.75, 1.1), height / 2)], 22,
    )  # fmt: skip
    line = np.vstack([(foot, -height / 2), (foot, 3 - height / 2), line])
    sites = sticks(rng, 18 - height / 2, knee - 10, stem, 4)
    sites += [
        Site(s.kind, s.point + _Y * (knee + 0.22 * height), s.along, s.out, bowl) for s in sticks(rng, 0, 1, bowl, 3)
    ]
    return with_sites(turned(line, corner=1.0), sites)


def lid(rng: Generator) -> Solid:
    """A flat lid with a knob or a bow to hold it by."""
    radius, thick = rng.uniform(40, 80), rng.uniform(5, 9)
    disc = turned(np.array([(radius, 0.0), (radius * rng.uniform(0.8, 1.0), thick)]))
    if rng.random() < 0.3:
        return union([disc, top_handle(rng, 34.0, thick)])
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
    return union([disc, with_sites(turned(line), [site, site, site])])


def tool_grip(rng: Generator) -> tuple[Solid, float]:
    """A handle to be held like that of a tool, from the origin up; and its length."""
    length, mean = rng.uniform(95, 165), rng.uniform(9, 17)
    radii = mean * (1 + rng.uniform(-0.15, 0.15, 5))
    solid = turned(curve(list(zip(radii, np.linspace(0, length, 5), strict=True)), 12), corner=2.5)
    flat = np.array([1.0, 1.0, rng.uniform(0.65, 1.25)])
    return with_sites(solid.scaled(flat), sticks(rng, 0.25 * length, 0.75 * length, mean, 6)), length


def pan(rng: Generator) -> Solid:
    grip, length = tool_grip(rng)
    radius, depth, wall = rng.uniform(38, 75), rng.uniform(14, 50), rng.uniform(3, 5)
    outer = np.array([(0.85 * radius, 0.0), (radius, depth)])
    inner = np.array([(0.0, wall), (0.85 * radius - wall, wall), (radius - wall, depth)])
    dish = turned(outer, inner, corner=1.2).moved(rotated(_Z, np.pi / 2))
    dish = dish.moved(rotated(_Y, rng.uniform(0, 2 * np.pi))).moved(shifted(_Y * (length + 0.93 * radius)))
    return union([grip, dish])


def tool(rng: Generator) -> Solid:
    grip, length = tool_grip(rng)
    head = rng.integers(4)
    if head == 0:
        part = box((rng.uniform(18, 30), rng.uniform(20, 35), rng.uniform(60, 110))).moved(shifted(_Y * (length + 8)))
    elif head == 1:
        radius = rng.uniform(3, 6)
        part = turned(np.array([(radius, length - 8), (radius, length + rng.uniform(50, 110))]), corner=1.0)
    elif head == 2:
        ball = trimesh.creation.icosphere(3, rng.uniform(18, 34))
        part = Solid(ball, (np.asarray(ball.vertices),)).moved(shifted(_Y * (length + 14)))
    else:
        part = box((rng.uniform(5, 10), rng.uniform(70, 110), rng.uniform(22, 45))).moved(shifted(_Y * (length + 30)))
    return union([grip, part])
