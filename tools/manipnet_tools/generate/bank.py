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
from manipnet_tools.generate.grasps import Grasp, find_grasp
from manipnet_tools.generate.in_hand import moved_in_hand
from manipnet_tools.generate.mirrored import Mirrored, Surface, mirrored_corners, mirrored_sites
from manipnet_tools.generate.proposals import Pinches, kinds_for, propose
from manipnet_tools.generate.shapes import MadeShape
from manipnet_tools.generate.simulate import Shaker, pose_of
from manipnet_tools.generate.solids import Site
from manipnet_tools.generate.two_hands import DOWNS, TwoHands

WANTED: Final = 12
"""Grasps for each hand."""
MOST_TRIES: Final = 240
WAYS: Final = 3
"""In so many directions an object may move in the hand."""
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
    ways: tuple[tuple[tuple[Array, Array], ...], ...]
    """Ways on which the object may move in the hand: poses of the wrist, each with the angles of the fingers there."""
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
    centre = seen.surface.center_of_mass
    ways = [way for _ in range(WAYS) if (way := moved_in_hand(tables, seen.space, grasp, centre, rng))]
    pose = _wrist(seen.side, grasp)
    downs = grasp.downs if pair < 0 else DOWNS
    joints = transform(pose_of(grasp), forward_kinematics(tables.hand, grasp.angles)[0])
    if seen.side == "left":
        joints, back = mirror_points(joints), mirror_points(back)
        downs = downs if pair >= 0 else mirror_points(downs)
    steps = tuple(tuple((_wrist(seen.side, step), step.angles) for step in way) for way in ways)
    touching = int(grasp.touching.sum())
    return Held(seen.side, grasp.kind, pose, grasp.angles, opened, back, downs, joints, touching, steps, pair)


def _wrist(side: Side, grasp: Grasp) -> Array:
    pose = pose_of(grasp)
    return mirror_poses(pose) if side == "left" else pose


def apart(first: Held, second: Held, least_m: float) -> bool:
    """Whether two hands that hold the object at once stay out of each other's way."""
    between = first.joints[:, None] - second.joints[None]
    return bool(np.linalg.norm(between, axis=2).min() > least_m)


def of_side(grasps: Sequence[Held], side: Side) -> list[Held]:
    """The grasps of one hand."""
    return [grasp for grasp in grasps if grasp.side == side]
