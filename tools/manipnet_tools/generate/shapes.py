"""Objects to be held, made by rule and chance: each number and seed gives one, always the same.

Sizes follow everyday things whose grips are 2 to 12 cm wide, and boxes and balls for two hands. None is taken from a
scanned or captured object.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.random import Generator

from manipnet.geometry import Array
from manipnet.synthesis.objects.mesh import ClosedMesh, closed_mesh
from manipnet_tools.generate.placing import rotated, shifted
from manipnet_tools.generate.simple_shapes import (
    ball,
    block,
    bottle,
    crate,
    goblet,
    letter,
    lid,
    pan,
    plate,
    prism,
    rod,
    superquadric,
    tool,
    torus,
    vase,
)
from manipnet_tools.generate.solids import Site, Solid, union
from manipnet_tools.generate.vessels import bowl, case, cup, jug, kettle, mug

TRIES: Final = 20
_X = np.array([1.0, 0.0, 0.0])


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


def _pair(rng: Generator) -> Solid:
    """Two simple bodies that overlap."""
    first, second = (_SIMPLE[int(rng.integers(len(_SIMPLE)))](rng) for _ in range(2))
    reach = 0.5 * first.mesh.extents * rng.uniform(0.3, 0.9, 3) * np.sign(rng.normal(size=3)) * (rng.random(3) < 0.6)
    return union([first, second.moved(rotated(_X, rng.uniform(0, np.pi))).moved(shifted(reach))])


_SIMPLE: Final = (block, prism, superquadric, vase)
KINDS: Final[dict[str, tuple[float, Callable[[Generator], Solid]]]] = {
    "mug": (15, mug), "jug": (9, jug), "kettle": (4, kettle), "case": (4, case), "pan": (6, pan),
    "tool": (7, tool), "lid": (5, lid), "goblet": (5, goblet), "cup": (6, cup), "bowl": (4, bowl),
    "bottle": (6, bottle), "vase": (5, vase), "rod": (4, rod), "plate": (4, plate), "torus": (3, torus),
    "box": (4, block), "prism": (3, prism), "superquadric": (4, superquadric), "letter": (3, letter),
    "pair": (3, _pair), "crate": (3, crate), "ball": (3, ball),
}  # fmt: skip
"""Kinds of shapes, how often each is made, and how."""
