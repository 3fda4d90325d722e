"""Motions of two hands with an object, made of reaches, holds, hand-overs and releases.

A wrist moves freely until it reaches, and arrives with the object's own motion along the direction of its grasp
(minimum jerk: Flash and Hogan 1985). The fingers open on the way, widest near two thirds of the reach, and each arrives
at its contact from outside (Smeets and Brenner 1999). While it is held, the object goes through random poses; fingers
and wrist are never quite still.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.random import Generator
from scipy.ndimage import gaussian_filter1d

from manipnet.geometry import (
    SIDES,
    Array,
    Side,
    compose,
    continuous_quats,
    invert,
    matrix_to_quat,
    mirror_poses,
    quat_exp,
    quat_multiply,
    transform,
)
from manipnet.synthesis.objects.shape import Shape
from manipnet_tools.assets.minimum_jerk import Move, ease, superpose
from manipnet_tools.generate.finger_tables import RELAXED

RATE_HZ: Final = 120.0
_DRIFT_M, _DRIFT_RAD = 0.0008, 0.006
_FREE_LIFE_RAD, _HELD_LIFE_RAD = np.radians(3.0), np.radians(3.0)
_CLEAR_M: Final = 0.12
"""A hand that does not hold keeps its palm this far from the object."""
_GIVES_WAY_M: Final = np.array([0.0, 0.05, 0.04])
_GIVES_WAY_S: Final = 0.06
_LIFE_HZ: Final = (0.4, 0.9, 1.8, 3.2, 5.0)


@dataclass(frozen=True, eq=False)
class Hold:
    """One hand holds the object, or only comes near it: times of its reach, contact, release and departure, seconds.

    `pose (7,)` is the wrist in the object's frame, mirrored for a left hand as everywhere; `angles` and `opened (A,)`
    are the grasp and the open hand before it; `back (3,)` is the way from which the hand comes, in the object's frame.
    """

    side: Side
    reach_s: float
    contact_s: float
    release_s: float
    away_s: float
    pose: Array
    angles: Array
    opened: Array
    back: Array
    near_only: bool = False
    shifts: tuple["Shift", ...] = ()
    """Between contact and release, one after the other."""


@dataclass(frozen=True, eq=False)
class Shift:
    """A small motion of a hand that holds: to the wrist pose `(7,)` in the object's frame, and to angles `(A,)`."""

    start_s: float
    end_s: float
    pose: Array
    angles: Array


@dataclass(frozen=True, eq=False)
class Scene:
    """Moves of the object from `start (7,)`, and the holds of both hands, over `length_s`."""

    length_s: float
    start: Array
    moves: Sequence[Move]
    holds: Sequence[Hold] = field(default_factory=tuple)


def play(
    scene: Scene, limits: Array, shape: Shape, rng: Generator
) -> tuple[Array, dict[Side, Array], dict[Side, Array]]:
    """Poses of the object `(T, 7)`, and of each hand's wrist `(T, 7)` and angles `(T, A)`, at `RATE_HZ`."""
    time_s = np.arange(int(scene.length_s * RATE_HZ)) / RATE_HZ
    obj = superpose(time_s, scene.start, scene.moves)
    held = np.zeros(len(time_s))
    for hold in scene.holds:
        if not hold.near_only:
            held = np.maximum(
                held,
                ease(time_s, hold.contact_s, hold.contact_s + 0.3) - ease(time_s, hold.release_s - 0.3, hold.release_s),
            )
    obj[:, :3] += held[:, None] * _life(time_s, 3, 0.0012, rng, _LIFE_HZ[:4])
    obj[:, 3:] = quat_multiply(obj[:, 3:], quat_exp(held[:, None] * _life(time_s, 3, 0.012, rng, _LIFE_HZ[:4])))
    wrists: dict[Side, Array] = {}
    angles: dict[Side, Array] = {}
    for side in SIDES:
        own = [hold for hold in scene.holds if hold.side == side]
        wrists[side] = _wrist(time_s, obj, own, side, shape, rng)
        angles[side] = _fingers(time_s, own, limits, rng)
    return obj, wrists, angles


def _wrist(time_s: Array, obj: Array, holds: Sequence[Hold], side: Side, shape: Shape, rng: Generator) -> Array:
    pose = _outside(_at_home(time_s, side, rng), obj, side, shape, np.ones(len(time_s)))
    arriving = np.zeros(len(time_s))
    for hold in holds:
        far = hold.pose.copy()
        far[:3] += hold.back * rng.uniform(0.05, 0.09)
        grasp = hold.pose
        if hold.near_only:
            grasp = far.copy()
            far = grasp.copy()
            far[:3] += 0.05 * hold.back
        reach, leave = hold.contact_s - hold.reach_s, hold.away_s - hold.release_s
        near = superpose(
            time_s,
            far,
            [
                Move(hold.contact_s - 0.45 * reach, hold.contact_s, grasp),
                *(Move(shift.start_s, shift.end_s, shift.pose) for shift in hold.shifts),
                Move(hold.release_s, hold.release_s + 0.5 * leave, far),
            ],
        )
        near[:, :3] += _life(time_s, 3, _DRIFT_M, rng, _LIFE_HZ[:2])
        near[:, 3:] = quat_multiply(near[:, 3:], quat_exp(_life(time_s, 3, _DRIFT_RAD, rng, _LIFE_HZ[:2])))
        share = ease(time_s, hold.reach_s, hold.contact_s - 0.2 * reach) - ease(
            time_s, hold.release_s + 0.15 * leave, hold.away_s
        )
        anchored = compose(obj, near)
        arriving += ease(time_s, hold.contact_s - 0.6 * reach, hold.contact_s - 0.25 * reach)
        arriving -= ease(time_s, hold.release_s + 0.25 * leave, hold.release_s + 0.7 * leave)
        pose = np.concatenate(
            [
                pose[:, :3] + share[:, None] * (anchored[:, :3] - pose[:, :3]),
                _turned(pose[:, 3:], anchored[:, 3:], share, time_s, hold),
            ],
            axis=1,
        )
    return _outside(pose, obj, side, shape, np.clip(1.0 - arriving, 0.0, 1.0))


def _turned(free: Array, held: Array, share: Array, time_s: Array, hold: Hold) -> Array:
    """Quaternions `(T, 4)` between two motions, on one way round for the whole reach and one for the whole departure.

    The shorter way at each frame would jump where the motions are half a turn apart.
    """
    free, held = continuous_quats(free), continuous_quats(held)
    early = time_s < 0.5 * (hold.contact_s + hold.release_s)
    for part, at_s in ((early, 0.5 * (hold.reach_s + hold.contact_s)), (~early, 0.5 * (hold.release_s + hold.away_s))):
        frame = min(int(at_s * RATE_HZ), len(time_s) - 1)
        held[part] *= 1.0 if free[frame] @ held[frame] >= 0.0 else -1.0
    mixed = free + share[:, None] * (held - free)
    return mixed / np.linalg.norm(mixed, axis=1, keepdims=True)


def _outside(pose: Array, obj: Array, side: Side, shape: Shape, share: Array) -> Array:
    """A wrist moved away from the object so that its palm stays clear of it, where its `share (T,)` is 1.

    It gives way from the middle of the object, and rather upward and toward the person. The normal of the nearest
    surface would make it jump where a palm passes through the middle.
    """
    palm = np.array([-0.095 if side == "left" else 0.095, 0.0, -0.02])
    middle = transform(obj, shape.center_of_mass)
    moved = pose.copy()
    for _ in range(2):
        place = transform(moved, palm)
        distance = shape.signed_distance(transform(invert(obj), place))[0]
        near = np.maximum(_CLEAR_M - distance, 0.0)
        push = near**2 / (near + 0.02) * share  # soft where it begins
        away = place - middle + _GIVES_WAY_M
        away /= np.linalg.norm(away, axis=1, keepdims=True) + 0.02
        moved[:, :3] += gaussian_filter1d(push[:, None] * away, _GIVES_WAY_S * RATE_HZ, axis=0)
    return moved


def _at_home(time_s: Array, side: Side, rng: Generator) -> Array:
    """A wrist that has nothing to do, in front of the body, which looks along -z."""
    at = _home(rng)
    moves, start = [], rng.uniform(0.2, 1.5)
    while start < time_s[-1]:
        length = rng.uniform(0.7, 1.8)
        moves.append(Move(start, start + length, _home(rng)))
        start += length * rng.uniform(1.0, 4.0)
    pose = superpose(time_s, at, moves)
    pose[:, :3] += _life(time_s, 3, 0.004, rng, _LIFE_HZ[:3])
    return mirror_poses(pose) if side == "left" else pose


def _home(rng: Generator) -> Array:
    """A pose of the right wrist beside the object's place: fingers forward, palm down or inward."""
    forward = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).T  # x forward, y to the left, z up
    turn = rng.normal(0.0, [0.3, 0.35, 0.35])
    turn[0] += rng.uniform(-0.3, 1.3)
    quat = quat_multiply(matrix_to_quat(forward), quat_exp(turn))
    return np.concatenate([[rng.uniform(0.1, 0.32), rng.uniform(-0.08, 0.2), rng.uniform(0.15, 0.4)], quat])


def _fingers(time_s: Array, holds: Sequence[Hold], limits: Array, rng: Generator) -> Array:
    count = len(limits)
    angles, moves_s = np.tile(_idle(limits, rng), (len(time_s), 1)), 0.0
    last = angles[0].copy()
    while (moves_s := moves_s + rng.uniform(1.5, 5.0)) < time_s[-1]:
        wanted = _idle(limits, rng)
        angles += ease(time_s, moves_s, moves_s + rng.uniform(0.6, 1.5))[:, None] * (wanted - last)
        last = wanted
    quiet = np.zeros(len(time_s))
    for hold in holds:
        reach, leave = hold.contact_s - hold.reach_s, hold.away_s - hold.release_s
        wide = rng.uniform(0.4, 1.0)
        for f in range(5):
            own = slice(4 * f, 4 * f + 4)
            lag = rng.normal(0.0, 0.02)
            opened = angles[:, own] + wide * (hold.opened[own] - angles[:, own])
            open_share = ease(time_s, hold.reach_s + 0.05 * reach, hold.reach_s + 0.66 * reach + lag)
            open_share -= ease(time_s, hold.release_s + 0.35 * leave, hold.away_s)
            closing = hold.contact_s - rng.uniform(0.3, 0.4) * reach
            closed = ease(time_s, closing + lag, hold.contact_s + rng.uniform(0.0, 0.1) + lag)
            closed -= ease(time_s, hold.release_s + lag - 0.05, hold.release_s + 0.45 * leave + lag)
            target = hold.opened[own] if hold.near_only else _held_angles(time_s, hold)[:, own]
            angles[:, own] += open_share[:, None] * (opened - angles[:, own])
            angles[:, own] += np.clip(closed, 0.0, 1.0)[:, None] * (target - angles[:, own])
        if not hold.near_only:
            quiet = np.maximum(
                quiet,
                ease(time_s, hold.contact_s - 0.2, hold.contact_s + 0.1)
                - ease(time_s, hold.release_s - 0.1, hold.release_s + 0.1),
            )
    life = _life(time_s, count, 1.0, rng, _LIFE_HZ)
    angles += life * (quiet * _HELD_LIFE_RAD + (1.0 - quiet) * _FREE_LIFE_RAD)[:, None]
    return np.clip(angles, *limits.T)


def _held_angles(time_s: Array, hold: Hold) -> Array:
    """Angles `(T, A)` of a hand that holds, with its shifts."""
    angles, before = np.tile(hold.angles, (len(time_s), 1)), hold.angles
    for shift in hold.shifts:
        angles += ease(time_s, shift.start_s, shift.end_s)[:, None] * (shift.angles - before)
        before = shift.angles
    return angles


def _idle(limits: Array, rng: Generator) -> Array:
    """A relaxed hand, each time another one; the fingers bend together."""
    angles = RELAXED.copy()
    bend, curl = rng.normal(0.0, 0.16), rng.normal(0.0, 0.22)
    for f in range(1, 5):
        angles[4 * f] += bend * (1.0 + 0.1 * f) + rng.normal(0.0, 0.05)
        angles[4 * f + 2] += curl + rng.normal(0.0, 0.06)
        angles[4 * f + 3] = 0.6 * angles[4 * f + 2]
        angles[4 * f + 1] = np.radians(6.0 - 4.0 * f) * rng.uniform(0.3, 1.3)
    angles[:4] += rng.normal(0.0, [0.12, 0.15, 0.12, 0.15])
    return np.clip(angles, *limits.T)


def _life(time_s: Array, columns: int, amplitude: float, rng: Generator, rates_hz: Sequence[float]) -> Array:
    """Small wandering `(T, columns)`, slower waves being larger."""
    values = np.zeros((len(time_s), columns))
    for rate in rates_hz:
        phase = 2.0 * np.pi * (rate * rng.uniform(0.75, 1.3, columns) * time_s[:, None] + rng.random(columns))
        values += np.sin(phase) / (1.0 + rate)
    return amplitude * values
