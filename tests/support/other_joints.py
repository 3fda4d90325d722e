"""Hands of another person for tests of `manipnet import`: their joints in motion, and an object that they hold."""

import numpy as np

from manipnet.geometry import Array, Side, quat_exp
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.synthesizer import hand_to_world
from manipnet_tools.importing.retarget import model_joints

HAND = shipped_hand()


def times_s(seconds: float, rate_hz: float) -> Array:
    return np.arange(round(seconds * rate_hz) + 1) / rate_hz


def angles_at(t_s: Array) -> Array:
    """Angles `(T, A)` well inside the limits, which open and close the hand."""
    lower, upper = HAND.limits.T
    phase = 0.5 + 0.3 * np.sin(2 * np.pi * 0.4 * t_s[:, None] + 0.3 * np.arange(HAND.angle_count))
    return lower + phase * (upper - lower) * 0.8 + 0.1 * (upper - lower)


def wrist_at(side: Side, t_s: Array) -> Array:
    """Wrist poses `(T, 7)` that move and turn."""
    x = 0.15 if side == "right" else -0.15
    places = np.stack([x + 0.05 * np.sin(t_s), 1.0 + 0.05 * np.cos(t_s), 0.1 * np.sin(2 * t_s)], axis=1)
    turns = quat_exp(np.stack([0.3 * np.sin(t_s), 0.4 * np.cos(t_s), 0.2 * t_s], axis=1))
    return np.concatenate([places, turns], axis=1)


def hand_joints(side: Side, t_s: Array, size: float = 1.0) -> Array:
    """The 21 joints `(T, 21, 3)` of a hand that is `size` times as large as the model's, metres, Y up."""
    positions, rotations = forward_kinematics(HAND, angles_at(t_s))
    world, _ = hand_to_world(side, wrist_at(side, t_s), size * positions, rotations)
    return world[:, model_joints(HAND)]


def object_poses(side: Side, t_s: Array) -> Array:
    """Poses `(T, 7)` of an object that moves with a hand, some centimetres from its palm."""
    poses = wrist_at(side, t_s)
    poses[:, :3] += [0.0, -0.06, 0.0]
    return poses


def write_box(path, half: float) -> None:
    """A closed box as OBJ."""
    import trimesh

    trimesh.creation.box([2 * half] * 3).export(path)
