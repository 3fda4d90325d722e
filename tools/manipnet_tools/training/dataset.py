"""Training samples: the same features as the live server's, computed at captured, perturbed and self-made poses.

A sample of tick `k` is what the server would see there (windows, sensors at the pose of tick `k - 1`) and the pose to
answer with. Hands are kept at the capture's 120 Hz, so both halves of it serve as 60 Hz ticks.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from manipnet.geometry import Array, continuous_quats, mirror_points, mirror_poses, mirror_quats, quat_to_matrix
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import angles_from_rotations, forward_kinematics
from manipnet.synthesis.model.features import Windows, features, joint_distances, pose_outputs
from manipnet.synthesis.model.layout import WINDOW_STEP_S
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.objects.shape import Shape, load_shape
from manipnet_tools.takes.take import Take, read_take

RATE_HZ = 120
TICK_FRAMES = 2
"""Frames of the capture per tick of the server."""
_WINDOW_FRAMES = round(WINDOW_STEP_S * RATE_HZ) * np.arange(-10, 11)


@dataclass(frozen=True, eq=False)
class HandTrack:
    """One captured hand as the network sees it, a left hand mirrored into a right one, at 120 Hz."""

    name: str
    hand: Hand
    """The subject's."""
    shape: Shape
    mirrored: bool
    wrist: Array
    """`(T, 7)`"""
    other_wrist: Array
    """`(T, 3)`"""
    object: Array
    """`(T, 7)`"""
    angles: Array
    """`(T, A)` captured fingers."""

    def __len__(self) -> int:
        return len(self.wrist)

    def backwards(self) -> "HandTrack":
        """The same played from its end."""
        flipped = {name: getattr(self, name)[::-1].copy() for name in ("wrist", "other_wrist", "object", "angles")}
        return replace(self, **flipped)

    def windows(self, frames: np.ndarray, speed: Array | None = None) -> Windows:
        """Windows about `frames (N,)`, the ends of the take held; `speed (N,)` plays time faster or slower."""
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


def _between(values: Array, at: Array) -> Array:
    """Linear interpolation at fractional frames; quaternions of neighbouring frames are close enough for that."""
    below = np.minimum(at.astype(np.int64), len(values) - 2)
    fraction = (at - below)[..., None]
    mixed = values[below] * (1.0 - fraction) + values[below + 1] * fraction
    if values.shape[-1] == 7:
        mixed[..., 3:] /= np.linalg.norm(mixed[..., 3:], axis=-1, keepdims=True)
    return mixed


def continuous(poses: Array) -> Array:
    """Poses `(T, 7)` with quaternion signs chosen so that neighbours are close."""
    return np.concatenate([poses[:, :3], continuous_quats(poses[:, 3:])], axis=1)


def hand_tracks(take: Take, shapes: dict[str, Shape]) -> list[HandTrack]:
    """Both hands of a take with captured fingers; `shapes` by object name."""
    name, subject = take.objects[0], shipped_hand()
    tracks = []
    for side, other in (("right", "left"), ("left", "right")):
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
        tracks.append(
            HandTrack(
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
    return tracks


def load_tracks(data: Path, takes: Iterable[str] | None = None) -> list[HandTrack]:
    """All hands of the takes in `data/BVH`, with meshes from `data/meshes`, by take name."""
    tracks = []
    for folder in sorted((data / "BVH").iterdir()):
        if takes is None or folder.name in set(takes):
            take = read_take(folder)
            shapes = {name: load_shape(data / "meshes" / f"{name}.obj") for name in take.objects}
            tracks += hand_tracks(take, shapes)
    return tracks


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
    track: HandTrack, frames: np.ndarray, before: Array, after: Array, windows: Windows | None = None
) -> Samples:
    """Samples of ticks at `frames (N,)`: the pose `before (N, A)` the tick is seen, `after (N, A)` is the answer."""
    windows = track.windows(frames) if windows is None else windows
    hand, shape = track.hand, track.shape
    inputs = features(hand, shape, windows, *forward_kinematics(hand, before))
    positions, rotations = forward_kinematics(hand, after)
    return Samples(inputs, pose_outputs(hand, positions, rotations, joint_distances(shape, windows, positions)))
