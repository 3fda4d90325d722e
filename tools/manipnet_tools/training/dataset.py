"""Captured hands, and training samples that the live server's own features make from them.

A sample of tick `k` is what the server would see there (trajectories, and sensors at the pose of tick `k - 1`) and the
pose that the network should answer with. Hands keep the 120 Hz of the capture, so that every second frame, counted from
any frame, serves as a tick at 60 Hz.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from manipnet.geometry import (
    SIDES,
    Array,
    Side,
    continuous_quats,
    invert,
    mirror_points,
    mirror_poses,
    mirror_quats,
    quat_to_matrix,
    transform,
)
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import angles_from_rotations, forward_kinematics
from manipnet.synthesis.model.features import Windows, features, joint_distances, pose_outputs
from manipnet.synthesis.model.layout import WINDOW_STEP_S
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.objects.shape import Shape, load_shape
from manipnet_tools.takes.dataset import mesh_file, take_folders
from manipnet_tools.takes.sources import captured_sides
from manipnet_tools.takes.take import Take, read_take

CAPTURE_HZ = 120
TICK_FRAMES = 2
"""Frames of the capture per tick of the server."""
HANDLED_FRAMES = 200
"""Frames of a take by which the object that a hand handles is found."""
_WINDOW_FRAMES = round(WINDOW_STEP_S * CAPTURE_HZ) * np.arange(-10, 11)


@dataclass(frozen=True, eq=False)
class CapturedHand:
    """One hand of a take as the network sees it, at 120 Hz. A left hand is mirrored into a right one."""

    name: str
    hand: Hand
    """The hand of the captured subject, or that of a generated take."""
    shape: Shape
    mirrored: bool
    wrist: Array
    """`(T, 7)`"""
    other_wrist: Array
    """`(T, 3)`"""
    object: Array
    """`(T, 7)`"""
    angles: Array
    """`(T, A)` captured joint angles."""

    def __len__(self) -> int:
        return len(self.wrist)

    def backwards(self) -> "CapturedHand":
        """The same take played from its end."""
        flipped = {name: getattr(self, name)[::-1].copy() for name in ("wrist", "other_wrist", "object", "angles")}
        return replace(self, **flipped)

    def windows(self, frames: np.ndarray, speed: Array | None = None) -> Windows:
        """Windows around `frames (N,)`. Beyond the ends of the take, the motion stands still.

        `speed (N,)` plays time faster or slower.
        """
        offsets = _WINDOW_FRAMES[None, :] * (np.ones((len(frames), 1)) if speed is None else speed[:, None])
        at = np.clip(frames[:, None] + offsets, 0, len(self) - 1)
        return Windows(
            _between(self.wrist, at),
            _between(self.other_wrist, at),
            _between(self.object, at),
            np.full(len(frames), self.mirrored),
            np.ones(len(frames)),
        )

    def angles_at(self, at: np.ndarray) -> Array:
        """Captured angles at fractional frames `(N,)`, `(N, A)`."""
        return _between(self.angles, np.clip(at, 0, len(self) - 1))


@dataclass(frozen=True, eq=False)
class TakeSet:
    """The hands of takes that belong together, such as those of one folder."""

    hands: Sequence[CapturedHand]
    weight: float = 1.0
    """A set gives samples in proportion to its weight, however long its takes are."""


def _between(values: Array, at: Array) -> Array:
    """Linear interpolation at fractional frames, which is exact enough for quaternions of neighbouring frames."""
    below = np.minimum(at.astype(np.int64), len(values) - 2)
    fraction = (at - below)[..., None]
    mixed = values[below] * (1.0 - fraction) + values[below + 1] * fraction
    if values.shape[-1] == 7:
        mixed[..., 3:] /= np.linalg.norm(mixed[..., 3:], axis=-1, keepdims=True)
    return mixed


def continuous(poses: Array) -> Array:
    """Poses `(T, 7)` with quaternion signs chosen so that neighbours are close."""
    return np.concatenate([poses[:, :3], continuous_quats(poses[:, 3:])], axis=1)


def captured_hands(take: Take, shapes: dict[str, Shape], sides: Sequence[Side] = SIDES) -> list[CapturedHand]:
    """The hands of a take with captured fingers, each with the object that it handles; `shapes` by object name."""
    subject = take.hand or shipped_hand()
    hands = []
    pairs: tuple[tuple[Side, Side], ...] = (("right", "left"), ("left", "right"))
    for side, other in pairs:
        if side not in sides:
            continue
        name = handled(take, side, shapes)
        mirrored = side == "left"
        quats = take.fingers[side].rotations
        wrist, obj = take.bodies[f"{side}_wrist"].poses, take.bodies[name].poses
        positions = take.bodies[f"{other}_wrist"].poses[:, :3]
        if mirrored:
            quats, wrist, obj = mirror_quats(quats), mirror_poses(wrist), mirror_poses(obj)
            positions = mirror_points(positions)
        world = quat_to_matrix(quats)
        local = np.swapaxes(world[:, :1], -1, -2) @ world
        angles = angles_from_rotations(subject, local)
        hands.append(
            CapturedHand(
                f"{take.name}/{side}",
                subject,
                shapes[name],
                mirrored,
                continuous(wrist),
                positions,
                continuous(obj),
                angles,
            )
        )
    return hands


def handled(take: Take, side: Side, shapes: dict[str, Shape]) -> str:
    """The object that a hand handles in a take: the one to which its knuckles and fingertips are nearest on average."""
    if len(shapes) == 1:
        return next(iter(shapes))
    frames = slice(None, None, max(len(take.time_s) // HANDLED_FRAMES, 1))
    joints = take.fingers[side].positions[frames]

    def distance_m(name: str) -> float:
        local = transform(invert(take.bodies[name].poses[frames])[:, None], joints)
        return float(np.maximum(shapes[name].signed_distance(local.reshape(-1, 3))[0], 0.0).mean())

    return min(shapes, key=distance_m)


def load_captured_hands(data: Path, takes: Sequence[str] = ()) -> list[CapturedHand]:
    """All hands of the takes in `data/BVH`, or of those named, with meshes from `data/meshes`.

    Raises `DataError`, `TakeError` and `MeshError`.
    """
    hands = []
    for folder in take_folders(data, takes):
        take = read_take(folder)
        shapes = {name: load_shape(mesh_file(data, name)) for name in take.objects}
        hands += captured_hands(take, shapes, captured_sides(data, folder.name))
    return hands


@dataclass(frozen=True)
class Samples:
    """Network inputs `(N, input_size)` and outputs `(N, output_size)`, float32, SI units."""

    inputs: np.ndarray
    outputs: np.ndarray

    def __len__(self) -> int:
        return len(self.inputs)


def concatenate(parts: Sequence[Samples]) -> Samples:
    """All samples of `parts`."""
    return Samples(np.concatenate([p.inputs for p in parts]), np.concatenate([p.outputs for p in parts]))


def samples_at(
    captured: CapturedHand, frames: np.ndarray, before: Array, after: Array, windows: Windows | None = None
) -> Samples:
    """Samples of ticks at `frames (N,)`: the network sees the pose `before (N, A)`, and `after (N, A)` is the answer.

    `windows` are the trajectories around the frames, by default at the speed of the capture.
    """
    windows = captured.windows(frames) if windows is None else windows
    hand, shape = captured.hand, captured.shape
    inputs = features(hand, shape, windows, *forward_kinematics(hand, before))
    positions, rotations = forward_kinematics(hand, after)
    return Samples(inputs, pose_outputs(hand, positions, rotations, joint_distances(shape, windows, positions)))
