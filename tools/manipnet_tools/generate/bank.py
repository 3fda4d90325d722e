"""The verified grasps of one object by both hands."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.random import Generator

from manipnet.geometry import SIDES, Array, Side, matrix_to_quat, mirror_points, mirror_poses, transform
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.objects.shape import Shape
from manipnet_tools.generate.approaches import approach
from manipnet_tools.generate.contact import mirrored_space, space_around
from manipnet_tools.generate.finger_tables import Tables
from manipnet_tools.generate.grasps import find_grasp
from manipnet_tools.generate.mirrored import Mirrored, mirrored_corners, mirrored_sites
from manipnet_tools.generate.proposals import Pinches, kinds_for, propose
from manipnet_tools.generate.shapes import MadeShape
from manipnet_tools.generate.simulate import Shaker

WANTED: Final = 12
"""Grasps for each hand."""
MOST_TRIES: Final = 240
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


@dataclass(frozen=True, eq=False)
class Bank:
    """Verified grasps, and how many were tried, found and verified, by kind; `refused` says why others were not."""

    grasps: tuple[Held, ...]
    tried: Counter[str]
    found: Counter[str]
    verified: Counter[str]
    refused: Counter[str]


def fill_bank(tables: Tables, pinches: tuple[Pinches, Pinches], made: MadeShape, shape: Shape, rng: Generator) -> Bank:
    """Grasps of one object by both hands."""
    bank = Bank((), Counter(), Counter(), Counter(), Counter())
    space = space_around(shape)
    corners = made.mesh.vertices[made.mesh.faces]
    grasps: list[Held] = []
    for side in SIDES:
        if side == "right":
            surface, around, triangles, sites, pieces = shape, space, corners, made.sites, made.pieces
        else:
            surface, around = Mirrored(shape), mirrored_space(space)
            triangles, sites = mirrored_corners(corners), mirrored_sites(made.sites)
            pieces = tuple(mirror_points(piece) for piece in made.pieces)
        shaker = Shaker(tables, surface, pieces)
        kinds, mine = kinds_for(made.sites), Counter[str]()
        for turn in range(MOST_TRIES):
            if mine.total() >= WANTED:
                break
            proposal = propose(tables, pinches, surface, triangles, sites, kinds, rng)
            if proposal is None:
                continue
            if mine[proposal.kind] >= _ALIKE * WANTED and turn < MOST_TRIES // 2:
                continue
            bank.tried[proposal.kind] += 1
            grasp = find_grasp(tables, around, proposal, surface.center_of_mass, bank.refused)
            if grasp is None:
                continue
            bank.found[grasp.kind] += 1
            if not shaker.holds(around, grasp):
                bank.refused["falls in the simulator"] += 1
                continue
            bank.verified[grasp.kind] += 1
            mine[grasp.kind] += 1
            opened, back = approach(tables, around, grasp)
            pose = np.concatenate([grasp.place, matrix_to_quat(grasp.turn)])
            joints = transform(pose, forward_kinematics(tables.hand, grasp.angles)[0])
            downs = grasp.downs
            if side == "left":
                pose, joints = mirror_poses(pose), mirror_points(joints)
                back, downs = mirror_points(back), mirror_points(downs)
            grasps.append(
                Held(side, grasp.kind, pose, grasp.angles, opened, back, downs, joints, int(grasp.touching.sum()))
            )
    return Bank(tuple(grasps), bank.tried, bank.found, bank.verified, bank.refused)


def apart(first: Held, second: Held, least_m: float) -> bool:
    """Whether two hands that hold the object at once stay out of each other's way."""
    between = first.joints[:, None] - second.joints[None]
    return bool(np.linalg.norm(between, axis=2).min() > least_m)


def of_side(grasps: Sequence[Held], side: Side) -> list[Held]:
    """The grasps of one hand."""
    return [grasp for grasp in grasps if grasp.side == side]
