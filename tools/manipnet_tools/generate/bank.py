"""The verified grasps of one object by both hands."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.random import Generator

from manipnet.geometry import Array, Side, mirror_points, mirror_poses, transform
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.objects.shape import Shape
from manipnet_tools.generate.approaches import approach
from manipnet_tools.generate.contact import Space, mirrored_space, space_around
from manipnet_tools.generate.finger_tables import Tables
from manipnet_tools.generate.grasps import Grasp, find_grasp, shifted_grasp
from manipnet_tools.generate.mirrored import Mirrored, Surface, mirrored_corners, mirrored_sites
from manipnet_tools.generate.proposals import Pinches, kinds_for, propose
from manipnet_tools.generate.shapes import MadeShape
from manipnet_tools.generate.simulate import Shaker, pose_of
from manipnet_tools.generate.solids import Site
from manipnet_tools.generate.two_hands import DOWNS, TwoHands

WANTED: Final = 12
"""Grasps for each hand."""
MOST_TRIES: Final = 240
SHIFTS: Final = 4
"""A hand that holds is never quite still: so many poses near each grasp are tried."""
_ALIKE: Final = 0.34
"""No kind makes up more than this share of a hand's grasps while others are still found."""


@dataclass(frozen=True, eq=False)
class Held:
    """A verified grasp of one hand. The pose of the wrist `(7,)` and all directions are in the object's frame, those of
    a left hand as everywhere: its wrist is the mirror image of a right one."""

    side: Side
    kind: str
    pose: Array
    angles: Array
    opened: Array
    back: Array
    downs: Array
    joints: Array
    """`(J, 3)`"""
    touching: int
    """How many capsules touch."""
    shifts: tuple[tuple[Array, Array], ...]
    """Poses of the wrist nearby, with the angles at which the same fingers still touch."""
    pair: int = -1
    """Two hands that hold only together have the same number, others -1."""


@dataclass(frozen=True, eq=False)
class Bank:
    """Verified grasps, and how many were tried, found and verified, by kind; `refused` says why others were not."""

    grasps: tuple[Held, ...]
    tried: Counter[str]
    found: Counter[str]
    verified: Counter[str]
    refused: Counter[str]


@dataclass(frozen=True, eq=False)
class _Side:
    """The object as one hand sees it: a left hand sees its mirror image."""

    side: Side
    surface: Surface
    space: Space
    corners: Array
    """`(F, 3, 3)` triangles."""
    sites: tuple[Site, ...]
    pieces: tuple[Array, ...]


def fill_bank(tables: Tables, pinches: tuple[Pinches, Pinches], made: MadeShape, shape: Shape, rng: Generator) -> Bank:
    """Grasps of one object by both hands, each alone or, where it is too wide for one, together."""
    bank = Bank((), Counter(), Counter(), Counter(), Counter())
    kinds = kinds_for(made.sites, float(np.ptp(made.mesh.vertices, axis=0).min()))
    sides = _sides(made, shape)
    if kinds == ("press",):
        right, left = (_candidates(tables, pinches, seen, kinds, bank, rng, 2 * WANTED) for seen in sides)
        both = TwoHands(tables, shape, (sides[0].space, sides[1].space), made.pieces)
        held: list[Held] = []
        for number, pair in enumerate(both.pairs(right, left, WANTED // 2, bank.refused)):
            bank.verified["press"] += 2
            held += [_held(tables, seen, grasp, number, rng) for seen, grasp in zip(sides, pair, strict=True)]
        return replace(bank, grasps=tuple(held))
    alone = [
        _held(tables, seen, grasp, -1, rng)
        for seen in sides
        for grasp in _candidates(
            tables, pinches, seen, kinds, bank, rng, WANTED, Shaker(tables, seen.surface, seen.pieces)
        )
    ]
    return replace(bank, grasps=tuple(alone))


def _sides(made: MadeShape, shape: Shape) -> tuple[_Side, _Side]:
    space, corners = space_around(shape), made.mesh.vertices[made.mesh.faces]
    pieces = tuple(mirror_points(piece) for piece in made.pieces)
    return (
        _Side("right", shape, space, corners, made.sites, made.pieces),
        _Side(
            "left",
            Mirrored(shape),
            mirrored_space(space),
            mirrored_corners(corners),
            mirrored_sites(made.sites),
            pieces,
        ),
    )


def _candidates(
    tables: Tables,
    pinches: tuple[Pinches, Pinches],
    seen: _Side,
    kinds: Sequence[str],
    bank: Bank,
    rng: Generator,
    wanted: int,
    shaker: Shaker | None = None,
) -> list[Grasp]:
    """Grasps of one hand, which the `shaker` has verified if there is one."""
    found, mine = [], Counter[str]()
    for turn in range(MOST_TRIES):
        if len(found) >= wanted:
            break
        proposal = propose(tables, pinches, seen.surface, seen.corners, seen.sites, kinds, rng)
        if proposal is None:
            continue
        if len(set(kinds)) > 1 and mine[proposal.kind] >= _ALIKE * wanted and turn < MOST_TRIES // 2:
            continue
        bank.tried[proposal.kind] += 1
        grasp = find_grasp(tables, seen.space, proposal, seen.surface.center_of_mass, bank.refused)
        if grasp is None:
            continue
        bank.found[grasp.kind] += 1
        if shaker is not None:
            if not shaker.holds(seen.space, grasp):
                bank.refused["falls in the simulator"] += 1
                continue
            bank.verified[grasp.kind] += 1
        mine[grasp.kind] += 1
        found.append(grasp)
    return found


def _held(tables: Tables, seen: _Side, grasp: Grasp, pair: int, rng: Generator) -> Held:
    """The grasp in the object's own frame, with the way to it."""
    opened, back = approach(tables, seen.space, grasp)
    shifts = [shifted for _ in range(SHIFTS) if (shifted := shifted_grasp(tables, seen.space, grasp, rng)) is not None]
    poses = np.array([pose_of(each) for each in (grasp, *shifts)])
    downs = grasp.downs if pair < 0 else DOWNS
    joints = transform(poses[0], forward_kinematics(tables.hand, grasp.angles)[0])
    if seen.side == "left":
        poses, joints, back = mirror_poses(poses), mirror_points(joints), mirror_points(back)
        downs = downs if pair >= 0 else mirror_points(downs)
    near = tuple((pose, shifted.angles) for pose, shifted in zip(poses[1:], shifts, strict=True))
    touching = int(grasp.touching.sum())
    return Held(seen.side, grasp.kind, poses[0], grasp.angles, opened, back, downs, joints, touching, near, pair)


def apart(first: Held, second: Held, least_m: float) -> bool:
    """Whether two hands that hold the object at once stay out of each other's way."""
    between = first.joints[:, None] - second.joints[None]
    return bool(np.linalg.norm(between, axis=2).min() > least_m)


def of_side(grasps: Sequence[Held], side: Side) -> list[Held]:
    """The grasps of one hand."""
    return [grasp for grasp in grasps if grasp.side == side]
