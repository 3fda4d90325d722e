"""Reads motion files in BVH without loss, and without the conventions of any dataset.

BVH has no standard. Programs differ in line ends, spaces in names, the order of channels, the rounding of the frame
time and the number of frames they announce; all of these variants are read. Position channels replace the offset of
their joint, as in the files of MotionBuilder, Maya, Blender and the ManipNet dataset.
"""

import logging
import re
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np

from manipnet.geometry import Array, quat_multiply
from manipnet_tools.takes.text_file import read_text

_AXES: Final = {"X": 0, "Y": 1, "Z": 2}
_CHANNELS: Final = {f"{axis}{kind}".lower(): f"{axis}{kind}" for axis in _AXES for kind in ("position", "rotation")}
_MOTION: Final = re.compile(r"^[ \t]*MOTION\s*$", re.IGNORECASE | re.MULTILINE)
_HEAD: Final = re.compile(r"\s*Frames\s*:\s*(\S+)\s+Frame\s+Time\s*:\s*(\S+)", re.IGNORECASE)
_DECIMAL_COMMA: Final = re.compile(r"\d,\d")
FRAME_TIMES_S: Final = (1e-4, 10.0)
_log = logging.getLogger(__name__)


class BvhError(ValueError):
    """A BVH file cannot be read; the text names the file, the place and what was expected."""


@dataclass(frozen=True)
class Joint:
    """One joint of the hierarchy. `offset` is in the file's units, `parent` is -1 for the root."""

    name: str
    parent: int
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    channels: tuple[str, ...] = ()
    end: tuple[float, float, float] | None = None
    """The offset of the End Site, if the joint has one."""


@dataclass(frozen=True)
class BvhMotion:
    """Hierarchy and motion. `motion` `(T, C)`: all channels in file order, degrees and file units."""

    joints: tuple[Joint, ...]
    frame_time_s: float
    motion: Array
    rounding_s: float = field(default=1e-9)
    """The last decimal place of the frame time in the file."""

    @property
    def rate_hz(self) -> float:
        """The frame rate: a whole number if the frame time, as far as it is written out, is that of one."""
        whole = round(1.0 / self.frame_time_s)
        is_whole = whole > 0 and self.rounding_s <= 1e-4 and abs(1.0 / whole - self.frame_time_s) <= self.rounding_s
        return float(whole) if is_whole else round(1.0 / self.frame_time_s, 3)

    def local_transforms(self) -> tuple[Array, Array]:
        """Translations `(T, J, 3)` and rotations `(T, J, 4)`, each relative to its parent.

        Along an axis with a position channel, the translation is that channel, and elsewhere it is the offset.
        """
        frames = len(self.motion)
        translations = np.tile(np.array([joint.offset for joint in self.joints], dtype=np.float64), (frames, 1, 1))
        rotations = np.tile([0.0, 0.0, 0.0, 1.0], (frames, len(self.joints), 1))
        column = 0
        for j, joint in enumerate(self.joints):
            for channel in joint.channels:
                axis, values = _AXES[channel[0]], self.motion[:, column]
                if channel.endswith("position"):
                    translations[:, j, axis] = values
                else:
                    rotations[:, j] = quat_multiply(rotations[:, j], _axis_rotation(axis, values))
                column += 1
        return translations, rotations


def read_bvh(path: Path | str) -> BvhMotion:
    """Read a BVH file; raises `BvhError` for a malformed file and `OSError` for an unreadable one.

    A number of frames other than the one announced, and a last frame that was cut off, are reported in the log.
    """
    path = Path(path)
    try:
        parts = _MOTION.split(read_text(path), maxsplit=1)
        if len(parts) != 2:
            raise BvhError("has no MOTION section")
        joints = _parse_hierarchy(re.findall(r"[{}]|[^\s{}]+", parts[0]))
        return _parse_motion(parts[1], joints, str(path))
    except BvhError as error:
        raise BvhError(f"{path}: {error}") from None


def _parse_hierarchy(tokens: list[str]) -> tuple[Joint, ...]:
    if [word.upper() for word in tokens[:2]] != ["HIERARCHY", "ROOT"]:
        raise BvhError("the file must start with HIERARCHY and a ROOT joint")
    joints: list[Joint] = []
    stack: list[int] = []  # the joint of each open brace, -1 - j inside the End Site of joint j
    at = 1
    try:
        while at < len(tokens):
            word = tokens[at].upper()
            if word in ("ROOT", "JOINT", "END"):
                brace = tokens.index("{", at)
                name = " ".join(tokens[at + 1 : brace])
                if word == "END":
                    stack.append(-1 - stack[-1])
                else:
                    _check_place(word, name, joints, stack)
                    joints.append(Joint(name, stack[-1] if stack else -1))
                    stack.append(len(joints) - 1)
                at = brace + 1
            elif word == "OFFSET":
                x, y, z = (_number(value) for value in tokens[at + 1 : at + 4])
                owner = stack[-1]
                if owner >= 0:
                    joints[owner] = replace(joints[owner], offset=(x, y, z))
                else:
                    joints[-1 - owner] = replace(joints[-1 - owner], end=(x, y, z))
                at += 4
            elif word == "CHANNELS":
                count = int(tokens[at + 1])
                joints[stack[-1]] = replace(joints[stack[-1]], channels=_channels(tokens[at + 2 : at + 2 + count]))
                at += 2 + count
            elif word == "}":
                stack.pop()
                at += 1
            else:
                raise BvhError(f"unexpected word {tokens[at]!r} in the hierarchy")
    except (IndexError, ValueError) as error:
        if isinstance(error, BvhError):
            raise
        raise BvhError(f"the hierarchy is cut off or has a bad number near word {at}: {error}") from None
    if stack:
        raise BvhError("a brace of the hierarchy is not closed")
    return tuple(joints)


def _check_place(word: str, name: str, joints: list[Joint], stack: list[int]) -> None:
    """Raise `BvhError` for a second root, and for a joint outside the root or inside an End Site."""
    if word == "ROOT" and joints and not stack:
        raise BvhError(f"has two roots, {joints[0].name!r} and {name!r}; export each into a file of its own")
    if (word == "ROOT") != (not stack) or (stack and stack[-1] < 0):
        raise BvhError(f"unexpected {word} {name!r}; a hierarchy is one ROOT with JOINTs inside it")


def _channels(words: list[str]) -> tuple[str, ...]:
    if unknown := [word for word in words if word.lower() not in _CHANNELS]:
        allowed = ", ".join(sorted(_CHANNELS.values()))
        raise BvhError(f"channels are {' '.join(words)}; {unknown[0]!r} is unknown, allowed are {allowed}")
    return tuple(_CHANNELS[word.lower()] for word in words)


def _parse_motion(text: str, joints: tuple[Joint, ...], where: str) -> BvhMotion:
    head = _HEAD.match(text)
    if head is None:
        raise BvhError("the MOTION section must begin with 'Frames: N' and 'Frame Time: S'")
    columns = sum(len(joint.channels) for joint in joints)
    try:
        announced, frame_time_s = int(head[1]), _number(head[2])
    except ValueError:
        raise BvhError(f"'Frames: {head[1]}' and 'Frame Time: {head[2]}' must be a whole number and seconds") from None
    if not FRAME_TIMES_S[0] <= frame_time_s <= FRAME_TIMES_S[1]:
        raise BvhError(f"the frame time is {frame_time_s} s; allowed are {FRAME_TIMES_S[0]} to {FRAME_TIMES_S[1]}")
    values = _values(text[head.end() :])
    frames, rest = divmod(len(values), columns) if columns else (0, 0)
    if rest:
        frames = _whole_frames(text[head.end() :], columns, where)
    if not frames:
        raise BvhError(f"holds no frame of {columns} channels; {announced} are announced")
    if frames != announced:
        _log.warning("%s: announces %d frames but has %d, which are used", where, announced, frames)
    motion = values[: frames * columns].reshape(frames, columns)
    if not np.isfinite(motion).all():
        row = int(np.argwhere(~np.isfinite(motion))[0, 0])
        raise BvhError(f"frame {row} has a number that is not finite")
    return BvhMotion(joints, frame_time_s, motion, _last_place(head[2]))


def _values(text: str) -> Array:
    """All numbers of the motion, `(N,)`."""
    try:
        return np.array(list(map(float, text.split())))  # 20 times faster than a conversion per line
    except ValueError as error:
        if _DECIMAL_COMMA.search(text):
            raise BvhError("the numbers have decimal commas; export the file with decimal points") from None
        raise BvhError(f"after 'Frame Time: S', the MOTION section must hold only numbers ({error})") from None


def _whole_frames(text: str, columns: int, where: str) -> int:
    """The number of whole frames, if only the last one is cut off. Raises `BvhError` otherwise."""
    widths = [len(line.split()) for line in text.splitlines() if line.strip()]
    wrong = [(n, width) for n, width in enumerate(widths) if width != columns]
    if wrong != [(len(widths) - 1, widths[-1])] or widths[-1] > columns:
        number, width = wrong[0]
        raise BvhError(f"frame {number} has {width} numbers; the channels of the hierarchy are {columns}")
    _log.warning("%s: ends in the middle of frame %d, which is left out", where, len(widths) - 1)
    return len(widths) - 1


def _number(text: str) -> float:
    if _DECIMAL_COMMA.search(text):
        raise BvhError(f"the number {text!r} has a decimal comma; export the file with decimal points")
    return float(text)


def _last_place(text: str) -> float:
    """The value of the last decimal place of a number as it is written, in which it is rounded."""
    digits, _, exponent = text.lower().partition("e")
    return 10.0 ** (int(exponent or 0) - len(digits.partition(".")[2]))


def _axis_rotation(axis: int, degrees: Array) -> Array:
    half = np.radians(degrees) / 2.0
    q = np.zeros((len(half), 4))
    q[:, axis], q[:, 3] = np.sin(half), np.cos(half)
    return q
