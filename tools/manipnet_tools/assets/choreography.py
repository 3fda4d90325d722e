"""Turns the script of a scene into tracks. A script says which hand grasps which object, how, and where it moves it.

Hands are scripted as right hands; a left hand makes the mirror image (through x = 0) of the scripted poses.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from manipnet.geometry import (
    SIDES,
    Array,
    Side,
    compose,
    invert,
    matrix_to_quat,
    mirror_points,
    mirror_poses,
    quat_exp,
    quat_multiply,
    quat_rotate,
)
from manipnet_tools.assets.minimum_jerk import Move, ease, superpose, tremor

Vector = tuple[float, float, float]

GRIP_CENTRE_M: Vector = (0.125, 0.010, -0.058)
"""Centre of a held object in the wrist frame, as measured on captured grasps."""
CLEARANCE_M: Vector = (-0.045, 0.0, 0.055)
"""Position of a hand relative to its grasp, in its wrist frame, before it closes and after it opens."""
SETTLE_S = 0.3
"""Within this time an object takes up the tremor of the hand that lifts it."""


@dataclass(frozen=True)
class Rest:
    """The hand rests at one pose in the world, `wrist (7,)`."""

    start_s: float
    end_s: float
    wrist: Array


@dataclass(frozen=True)
class Grasp:
    """The hand is fixed to a body; `fingers` and `palm` are world directions at the beginning of the grasp."""

    start_s: float
    end_s: float
    body: str
    fingers: Vector
    palm: Vector
    at: Vector = (0.0, 0.0, 0.0)
    """The held point, relative to the body's origin along the world's axes."""
    centre: Vector = GRIP_CENTRE_M
    """The held point in the wrist frame."""


def hand_pose(fingers: Vector, palm: Vector, p_world: Vector | Array, p_wrist: Vector = (0.0, 0.0, 0.0)) -> Array:
    """Pose `(7,)` of a right wrist with these directions of fingers and palm; its point `p_wrist` is at `p_world`."""
    x = np.array(fingers) / np.linalg.norm(fingers)
    z = x * (np.array(palm) @ x) - np.array(palm)
    z /= np.linalg.norm(z)
    rotation = matrix_to_quat(np.stack([x, np.cross(z, x), z], axis=-1))
    return np.concatenate([np.array(p_world) - quat_rotate(rotation, np.array(p_wrist)), rotation])


def object_pose(position: Vector, yaw: float = 0.0, pitch: float = 0.0, roll: float = 0.0) -> Array:
    """A pose `(7,)` turned about Y, then about the world's X, then about Z; angles in degrees."""
    about_y, about_x, about_z = (
        quat_exp(np.radians(angle) * np.eye(3)[axis]) for angle, axis in ((yaw, 1), (pitch, 0), (roll, 2))
    )
    return np.concatenate([position, quat_multiply(about_z, quat_multiply(about_x, about_y))])


def perform(
    time_s: Array,
    homes: Mapping[str, Array],
    moves: Mapping[str, Sequence[Move]],
    hands: Mapping[Side, Sequence[Rest | Grasp]],
) -> dict[str, Array]:
    """World poses `(T, 7)` of both wrists and every body; the bodies start at `homes (7,)`."""
    period_s = float(time_s[-1] + time_s[1] - 2.0 * time_s[0])
    tracks = {name: superpose(time_s, home, moves.get(name, ())) for name, home in homes.items()}
    shakes = {side: tremor(time_s, period_s, salt) for salt, side in enumerate(SIDES)}
    wrists = {}
    for side in SIDES:
        wrists[f"{side}_wrist"] = _wrist(time_s, side, hands[side], tracks)
        wrists[f"{side}_wrist"][:, :3] += shakes[side]
    for name, track in tracks.items():
        grip = {side: _carried(time_s, name, hands[side], moves.get(name, ())) for side in SIDES}
        total = np.maximum(sum(grip.values()), 1.0)
        track[:, :3] += sum((grip[side] / total)[:, None] * shakes[side] for side in SIDES)
    return wrists | tracks


def _wrist(time_s: Array, side: Side, script: Sequence[Rest | Grasp], tracks: Mapping[str, Array]) -> Array:
    """Wrist poses `(T, 7)`: fixed to a place or a body, and moving from one to the next in between."""
    poses = np.empty((len(time_s), 7))
    held = [_fixed(time_s, side, part, tracks) for part in script]
    for part, track in zip(script, held, strict=True):
        on = (time_s >= part.start_s) & (time_s <= part.end_s)
        poses[on] = track[on]
    for k in range(len(script) - 1):
        a, b = script[k], script[k + 1]
        between = (time_s > a.end_s) & (time_s < b.start_s)
        last, first = (np.searchsorted(time_s, t) for t in (a.end_s, b.start_s))
        start, goal = held[k][last], held[k + 1][first]
        poses[between] = superpose(time_s[between], start, _reach(side, a, b, start, goal))
    return poses


def _reach(side: Side, a: Rest | Grasp, b: Rest | Grasp, start: Array, goal: Array) -> list[Move]:
    """The moves from one place to the next without a stop: away from the held object, across, and onto the next one."""
    clear = np.array([*CLEARANCE_M, 0.0, 0.0, 0.0, 1.0])
    if side == "left":
        clear = mirror_poses(clear)
    leaves, arrives = isinstance(a, Grasp), isinstance(b, Grasp)
    across = (0.12 if leaves else 0.0, 0.80 if arrives else 1.0)
    moves = []
    if leaves:
        moves.append((0.0, 0.42, compose(start, clear)))
    moves.append((*across, compose(goal, clear) if arrives else goal))
    if arrives:
        moves.append((0.45, 1.0, goal))
    span = b.start_s - a.end_s
    return [Move(a.end_s + u * span, a.end_s + v * span, pose) for u, v, pose in moves]


def _fixed(time_s: Array, side: Side, part: Rest | Grasp, tracks: Mapping[str, Array]) -> Array:
    """Wrist poses `(T, 7)` of a hand that stays at this part of the script all the time."""
    if isinstance(part, Rest):
        wrist = part.wrist if side == "right" else mirror_poses(part.wrist)
        return np.tile(wrist, (len(time_s), 1))
    track = tracks[part.body]
    T_world_body = track[np.searchsorted(time_s, part.start_s)]
    point = T_world_body[:3] + np.array(part.at)
    if side == "left":
        T_world_wrist = mirror_poses(hand_pose(part.fingers, part.palm, mirror_points(point), part.centre))
    else:
        T_world_wrist = hand_pose(part.fingers, part.palm, point, part.centre)
    return compose(track, compose(invert(T_world_body), T_world_wrist)[None])


def _carried(time_s: Array, name: str, script: Sequence[Rest | Grasp], moves: Sequence[Move]) -> Array:
    """Share `(T,)`, 0 to 1, of the hand's tremor that a body takes up while the hand holds it above the table."""
    share = np.zeros(len(time_s))
    for part in script:
        if isinstance(part, Grasp) and part.body == name:
            within = [move for move in moves if move.start_s < part.end_s and move.end_s > part.start_s]
            start, end = max(part.start_s, within[0].start_s), min(part.end_s, within[-1].end_s)
            rise = ease(time_s, start, start + SETTLE_S)
            share += rise - ease(time_s, end - SETTLE_S, end)
    return share
