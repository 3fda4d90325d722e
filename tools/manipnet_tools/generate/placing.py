"""Places to hold an object by, and motions of solids. Millimetres, Y up."""

from collections.abc import Sequence

import numpy as np
import trimesh
from numpy.random import Generator

from manipnet.geometry import Array
from manipnet_tools.generate.solids import Site, Solid

_Y = np.array([0.0, 1.0, 0.0])


def sticks(rng: Generator, low: float, high: float, radius: float, count: int) -> list[Site]:
    """Places on a stick along Y."""
    angles, heights = rng.uniform(0, 2 * np.pi, count), rng.uniform(min(low, high), max(low, high), count)
    return [
        Site("stick", _Y * height, _Y, np.array([np.cos(angle), 0.0, np.sin(angle)]), radius)
        for angle, height in zip(angles, heights, strict=True)
    ]


def rims(rng: Generator, radius: float, height: float, half: float, count: int, outward: bool = False) -> list[Site]:
    """Places on a round rim, held from above or, if `outward`, from aside."""
    sites = []
    for angle in rng.uniform(0, 2 * np.pi, count):
        out = np.array([np.cos(angle), 0.0, np.sin(angle)])
        sites.append(Site("rim", radius * out + height * _Y, np.cross(_Y, out), out if outward else _Y, half))
    return sites


def with_sites(solid: Solid, sites: Sequence[Site]) -> Solid:
    return Solid(solid.mesh, solid.pieces, (*solid.sites, *sites))


def shifted(by: Array) -> Array:
    return trimesh.transformations.translation_matrix(by)


def rotated(axis: Array, angle: float) -> Array:
    return np.asarray(trimesh.transformations.rotation_matrix(angle, axis))
