"""Finds grasps of one object by searching how each finger may end at a pose of the wrist.

The way there is not searched: a finger that closes from the open hand stops on the wall behind a handle and never
makes the fist that people make. The four fingers are chosen together, so that neighbours are alike; then the thumb, so
that it opposes them; then all are moved a little until they touch (`contact.settle`). What cannot carry the object
whichever way gravity points is refused (`forces`).
"""

from collections import Counter
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from manipnet.geometry import Array
from manipnet_tools.generate.contact import Space, distance_of, look, score_rows, settle
from manipnet_tools.generate.finger_tables import RELAXED, FingerTable, Tables
from manipnet_tools.generate.forces import carried, cone_columns
from manipnet_tools.generate.proposals import ONE_SIDED, Proposal

ROWS: Final = 36
"""Rows of each finger's table that are considered."""
THUMBS: Final = 4
TOUCH_M: Final = 0.0025
DEEPEST_M: Final = 0.0038
OVERLAP_M: Final = 0.0045
FOREARM_M: Final = 0.028
SHIFT_M, SHIFT_RAD = 0.004, 0.06
"""How far a wrist moves about a grasp, along and about each axis, one standard deviation."""
NEIGHBOURS: Final = 0.05
"""What it costs that neighbouring fingers bend differently."""
OPPOSED: Final = 3.0
"""What it is worth that the thumb presses against what the fingers press on: more than how well it touches, because
people hold between a thumb and the fingers that oppose it (Napier 1956)."""
_ROUNDS: Final = 6


@dataclass(frozen=True, eq=False)
class Grasp:
    """A right hand on an object: the wrist's `turn (3, 3)` and `place (3,)` in the object's frame, `angles (A,)`."""

    kind: str
    turn: Array
    place: Array
    angles: Array
    along: Array
    """`(3,)` the direction in which the hand arrives."""
    touching: NDArray[np.bool_]
    """`(C,)` the capsules that touch."""
    downs: Array
    """`(n, 3)` the directions of gravity in which it holds."""


def find_grasp(tables: Tables, space: Space, proposal: Proposal, centre: Array, refused: Counter[str]) -> Grasp | None:
    """The grasp at a proposed pose, or nothing; `refused` counts why not. `centre (3,)` is the centre of mass."""
    turn, place = np.ascontiguousarray(proposal.turn), np.ascontiguousarray(proposal.place)
    if not _arm_free(space, turn, place):
        refused["arm or palm inside"] += 1
        return None
    proposal = replace(proposal, wanted=_taking_part(tables, space, turn, place, proposal))
    angles = _fingers(tables, space, turn, place, proposal.wanted)
    if angles is None:
        refused["fingers do not touch"] += 1
        return None
    reason = "thumb does not touch"
    for thumb in _thumbs(tables, space, turn, place, angles, proposal):
        grasp, reason = _settled(tables, space, turn, place, thumb, proposal, centre)
        if grasp is not None:
            return grasp
    refused[reason] += 1
    return None


def _arm_free(space: Space, turn: Array, place: Array) -> bool:
    """Whether the wrist and a straight forearm are outside the object."""
    return all(
        distance_of(space, place - 0.02 * k * turn[:, 0]) > (0.018 if k == 0 else FOREARM_M) for k in range(0, 9, 2)
    )


def _taking_part(tables: Tables, space: Space, turn: Array, place: Array, proposal: Proposal) -> Array:
    """What contacts are worth, `(5, 3)`, with zeros for the fingers whose knuckles are too far from the object."""
    ring, little = look(space, tables.body, RELAXED, turn, place)[0][2:4]
    wanted = proposal.wanted.copy()
    if little > proposal.nearest_m:
        wanted[3 if ring > proposal.nearest_m else 4 :] = 0.0
    return wanted


def _scored(
    space: Space, turn: Array, place: Array, table: FingerTable, radii: Array, wanted: Array
) -> tuple[Array, Array]:
    gaps, scores = np.empty((len(table.costs), 3)), np.empty(len(table.costs))
    score_rows(space, turn, place, table.points, radii[table.capsules], table.pads, wanted, gaps, scores)
    return gaps, scores


def _fingers(tables: Tables, space: Space, turn: Array, place: Array, wanted: Array) -> Array | None:
    """Angles with the four fingers chosen together (Viterbi 1967), the thumb relaxed."""
    chosen, values = [], []
    for f in range(1, 5):
        table = tables.fingers[f]
        gaps, scores = _scored(space, turn, place, table, tables.hand.radii, wanted[f])
        if wanted[f].any():
            value = scores - table.costs
        else:
            away = (table.angles - RELAXED[table.columns]) / [0.6, 0.15, 0.7, 0.5]
            value = -0.3 * np.sum(away**2, axis=1) - np.where(gaps.min(axis=1) > 0.001, 0.0, 1.0)
            value -= np.maximum(-0.002 - gaps.min(axis=1), 0.0) / 0.001
        rows = np.argpartition(-value, ROWS)[:ROWS]
        if wanted[f].any() and gaps[rows].min() > 0.006:
            rows = rows[np.argsort(table.costs[rows])]
        chosen.append(rows)
        values.append(value[rows])
    best, back = values[0], []
    for f in range(1, 4):
        before, after = (tables.fingers[g].angles[rows] for g, rows in ((f, chosen[f - 1]), (f + 1, chosen[f])))
        apart = (after[:, None] - before[None]) / [0.3, 0.3, 0.4, 0.6]
        crossed = np.maximum(after[:, None, 1] - before[None, :, 1], 0.0) / 0.1
        total = best[None] - NEIGHBOURS * np.sum(apart[..., [0, 2]] ** 2, axis=2) - crossed
        back.append(total.argmax(axis=1))
        best = values[f] + total.max(axis=1)
    at = int(best.argmax())
    if best[at] < -3.0:
        return None
    angles = RELAXED.copy()
    for f in range(4, 0, -1):
        table = tables.fingers[f]
        angles[table.columns] = table.angles[chosen[f - 1][at]]
        if f > 1:
            at = int(back[f - 2][at])
    return angles


def _thumbs(tables: Tables, space: Space, turn: Array, place: Array, angles: Array, proposal: Proposal) -> list[Array]:
    """Angles with the best thumbs: they touch, oppose the fingers, and do not run into them."""
    table, wanted = tables.fingers[0], proposal.wanted[0]
    worth = 0.0 if proposal.kind in ONE_SIDED else OPPOSED
    _, scores = _scored(space, turn, place, table, tables.hand.radii, wanted)
    value = scores - table.costs
    rows = np.argpartition(-value, 4 * ROWS)[: 4 * ROWS]
    kept: list[tuple[float, Array]] = []
    for row in rows:
        posed = angles.copy()
        posed[table.columns] = table.angles[row]
        near, _, normals, clear = look(space, tables.body, posed, turn, place)
        touching = near[7:] < 2.0 * TOUCH_M
        opposed = -float(normals[6] @ normals[7:][touching].mean(axis=0)) if touching.any() else 0.0
        tip = worth * opposed * (near[6] < 2.0 * TOUCH_M)
        kept.append((value[row] + tip + min(clear + 0.002, 0.0) / 0.002, posed))
    kept.sort(key=lambda entry: -entry[0])
    return [posed for _, posed in kept[:THUMBS]]


def _settled(
    tables: Tables, space: Space, turn: Array, place: Array, angles: Array, proposal: Proposal, centre: Array
) -> tuple[Grasp | None, str]:
    hand, body = tables.hand, tables.body
    gaps = look(space, body, angles, turn, place)[0]
    wants = np.concatenate([np.full(4, 0.3), np.minimum(proposal.wanted.ravel(), 1.0)]) * (gaps < 0.009)
    stiff = np.concatenate([np.full(20, 1.0 / 0.3), np.full(3, 1.0 / 0.08), np.full(3, 1.0 / 0.005)])
    stiff[5::4] = 1.0 / 0.12
    x = settle(space, body, angles, turn, place, wants, stiff, _ROUNDS)
    turned, moved, posed = turn @ _rotation(x[20:23]), place + x[23:], x[:20].copy()
    turned, moved = np.ascontiguousarray(turned), np.ascontiguousarray(moved)
    gaps, points, normals, clear = look(space, body, posed, turned, moved)
    if gaps.min() < -DEEPEST_M:
        return None, "too deep"
    if clear < -OVERLAP_M:
        return None, "fingers overlap"
    if not _arm_free(space, turned, moved):
        return None, "arm or palm inside"
    touching = np.asarray(gaps < TOUCH_M)
    digits: NDArray[np.bool_] = np.any(touching[4:].reshape(5, 3), axis=1)
    if not all(digits[f] for f in proposal.needed):
        return None, "a needed digit does not touch"
    on_surface = points[touching] - normals[touching] * (gaps + hand.radii)[touching, None]
    if not carried(cone_columns(on_surface, normals[touching], centre), proposal.downs).all():
        return None, "does not carry the object"
    return Grasp(proposal.kind, turned, moved, posed, proposal.along, touching, proposal.downs), ""


def shifted_grasp(tables: Tables, space: Space, grasp: Grasp, rng: Generator) -> Grasp | None:
    """The same grasp after a small motion of the wrist, or nothing if the fingers cannot follow it.

    The fingers that touch go on touching, about where they did; the others stay as they are.
    """
    turn = np.ascontiguousarray(grasp.turn @ _rotation(rng.normal(0.0, SHIFT_RAD, 3)))
    place = grasp.place + rng.normal(0.0, SHIFT_M, 3)
    stiff = np.concatenate([np.full(20, 1.0 / 0.3), np.full(6, 1e6)])
    stiff[5::4] = 1.0 / 0.12
    angles = settle(space, tables.body, grasp.angles, turn, place, grasp.touching.astype(float), stiff, _ROUNDS)[
        :20
    ].copy()
    gaps, _, _, clear = look(space, tables.body, angles, turn, place)
    touched = np.any(grasp.touching[4:].reshape(5, 3), axis=1)
    off = np.min(gaps[4:].reshape(5, 3), axis=1)[touched].max(initial=0.0) > 2.0 * TOUCH_M
    if off or gaps.min() < -DEEPEST_M or clear < -OVERLAP_M:
        return None
    return replace(grasp, turn=turn, place=place, angles=angles)


def _rotation(vector: Array) -> Array:
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / max(angle, 1e-12)
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * skew + (1.0 - np.cos(angle)) * (skew @ skew)
