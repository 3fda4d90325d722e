"""Reads a take in the layout of the ManipNet dataset: `leftHand.bvh`, `rightHand.bvh` and one `<object>.bvh` each.

The dataset's own files are left-handed and in decimetres. A folder in another unit, or right-handed as `manipnet export
--right-handed` writes it, is recognised by the lengths and directions of the hands' bones.
"""

import logging
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from manipnet.geometry import SIDES, Array, Side, mirror_points, mirror_poses, mirror_quats, quat_multiply, quat_rotate
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.objects.units import UNITS_M
from manipnet_tools.takes.bvh_motion import BvhError, BvhMotion, read_bvh

_Ordered = tuple[Array, Array]
"""Translations `(T, 17, 3)` and rotations `(T, 17, 4)` of a hand's bones in their order, each in its parent bone."""
SPARE_FRAMES: Final = 2
"""Files of one take may differ by this many frames at their ends, which are left out."""
SIZE_RATIOS: Final = (0.5, 1.6)
"""How large a hand may be, relative to the model's, to be recognised as one."""
HANDS: Final = tuple(f"{side}Hand" for side in SIDES)
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class BvhFolder:
    """T frames in the project frame: captured hands by side, and poses of objects `(T, 7)` by name."""

    rate_hz: float
    hands: dict[Side, tuple[Array, Array]]
    """Joints `(T, 22, 3)` and bone rotations `(T, 17, 4)`."""
    objects: dict[str, Array]


def read_bvh_folder(folder: Path) -> BvhFolder:
    """Read a folder. Raises `BvhError`."""
    files = _files(folder)
    rate_hz = _rate(files, folder)
    frames = _shortest(files, folder)
    hand = shipped_hand()  # the dataset's subject, whose fingertips its files lack
    ordered: dict[Side, _Ordered] = {
        side: _in_order(files[f"{side}Hand"], hand, folder / f"{side}Hand.bvh") for side in SIDES
    }
    space = _space(ordered, hand, folder)
    hands: dict[Side, tuple[Array, Array]] = {side: _hand(ordered[side], frames, side, hand, space) for side in SIDES}
    objects = {stem: _root_poses(bvh, frames, space) for stem, bvh in files.items() if stem not in HANDS}
    return BvhFolder(rate_hz, hands, objects)


def bvh_files(folder: Path) -> list[Path]:
    """The BVH files in a folder, in order, also those that a program has written as `.BVH`."""
    return sorted(path for path in folder.iterdir() if path.suffix.lower() == ".bvh" and path.is_file())


def _files(folder: Path) -> dict[str, BvhMotion]:
    """All BVH files by name. The hands have the dataset's names, whether their files are written in capitals or not."""
    hands = {name.lower(): name for name in HANDS}
    files: dict[str, BvhMotion] = {}
    for path in bvh_files(folder):
        stem = hands.get(path.stem.lower(), path.stem)
        if stem in files:
            raise BvhError(
                f"{folder}: two files are called {stem}.bvh if capital letters are ignored; keep one of them"
            )
        files[stem] = read_bvh(path)
    if wrists := {"left_wrist", "right_wrist"} & files.keys():
        raise BvhError(
            f"{folder}: {min(wrists)} is the name of a wrist; call the object {min(wrists)}.bvh something else"
        )
    if missing := set(HANDS) - files.keys():
        raise BvhError(f"{folder}: no {' and no '.join(sorted(missing))}.bvh; a take needs both hands' files")
    return files


def _rate(files: dict[str, BvhMotion], folder: Path) -> float:
    """The rate of all files. Some may write their frame times with fewer decimals than others."""
    finest = min(files.values(), key=lambda bvh: bvh.rounding_s)
    apart = [abs(bvh.frame_time_s - finest.frame_time_s) > bvh.rounding_s for bvh in files.values()]
    if any(apart):
        rates = ", ".join(f"{stem} {bvh.rate_hz:g} Hz" for stem, bvh in files.items())
        raise BvhError(f"{folder}: the files of a take must have one rate, found {rates}")
    return finest.rate_hz


def _shortest(files: dict[str, BvhMotion], folder: Path) -> int:
    lengths = {stem: len(bvh.motion) for stem, bvh in files.items()}
    shortest, longest = min(lengths.values()), max(lengths.values())
    if longest - shortest > SPARE_FRAMES:
        found = ", ".join(f"{stem} {length}" for stem, length in lengths.items())
        raise BvhError(f"{folder}: the files of a take must have the same number of frames, found {found}")
    if longest > shortest:
        longer = ", ".join(sorted(stem for stem, length in lengths.items() if length > shortest))
        _log.warning("%s: only %d frames are used, because %s have more than the others", folder, shortest, longer)
    return shortest


def _in_order(bvh: BvhMotion, hand: Hand, path: Path) -> _Ordered:
    """The motion of the hand's bones. Joints may have a prefix, as in `Bip01 INDEX_MCP` and `Ann:INDEX_MCP`."""
    expected = hand.joint_names[: hand.bone_count]
    found = {_bare(joint.name): j for j, joint in enumerate(bvh.joints)}
    if len(bvh.joints) != len(expected) or set(found) != set(expected):
        names = " ".join(joint.name for joint in bvh.joints)
        unknown = [joint.name for joint in bvh.joints if _bare(joint.name) not in expected]
        reason = f"; {unknown[0]!r} is not one of them" if unknown else ""
        raise BvhError(f"{path}: joints must be {' '.join(expected)}, found {names}{reason}")
    order = [found[name] for name in expected]
    for name, j, parent in zip(expected, order, hand.parents[: hand.bone_count].tolist(), strict=True):
        actual = bvh.joints[j].parent
        if actual != (order[parent] if parent >= 0 else -1):
            above = bvh.joints[actual].name if actual >= 0 else "none"
            raise BvhError(f"{path}: the parent of {name} must be {expected[parent]}, found {above}")
    translations, rotations = bvh.local_transforms()
    return translations[:, order], rotations[:, order]


def _bare(name: str) -> str:
    return re.split(r"[\s:]", name)[-1]


@dataclass(frozen=True)
class _Space:
    """The unit of a file's lengths, and whether it is left-handed."""

    unit_m: float
    mirrored: bool

    def points(self, points: Array) -> Array:
        return self.unit_m * (mirror_points(points) if self.mirrored else points)

    def quats(self, quats: Array) -> Array:
        return mirror_quats(quats) if self.mirrored else quats


def _space(hands: dict[Side, _Ordered], hand: Hand, folder: Path) -> _Space:
    """The unit and handedness in which the bones of both hands are those of a hand. Raises `BvhError`."""
    measured = {side: np.median(translations[:, 1:], axis=0) for side, (translations, _) in hands.items()}
    model = hand.offsets[1 : hand.bone_count]
    size = float(np.mean([np.linalg.norm(offsets, axis=1).sum() for offsets in measured.values()]))
    ratios = {unit: size * metres / float(np.linalg.norm(model, axis=1).sum()) for unit, metres in UNITS_M.items()}
    unit = min(ratios, key=lambda unit: abs(np.log(max(ratios[unit], 1e-9))))
    if not SIZE_RATIOS[0] <= ratios[unit] <= SIZE_RATIOS[1]:
        raise BvhError(
            f"{folder}: the hands' bones have lengths that do not fit a hand in any unit ({', '.join(UNITS_M)})"
        )
    errors = {}
    for mirrored in (True, False):
        space = _Space(UNITS_M[unit] / ratios[unit], mirrored)
        expected = {side: model if side == "right" else mirror_points(model) for side in SIDES}
        errors[mirrored] = sum(np.linalg.norm(space.points(measured[side]) - expected[side]) for side in SIDES)
    mirrored = bool(errors[True] <= errors[False])
    if (unit, mirrored) != ("dm", True):
        handedness = "left-handed" if mirrored else "right-handed"
        _log.info("%s: is read as %s and in %s, judging by the bones of the hands", folder, handedness, unit)
    return _Space(UNITS_M[unit], mirrored)


def _root_poses(bvh: BvhMotion, frames: int, space: _Space) -> Array:
    """Poses `(T, 7)` of the root in the project frame."""
    root = BvhMotion(bvh.joints[:1], bvh.frame_time_s, bvh.motion[:frames, : len(bvh.joints[0].channels)])
    translations, rotations = root.local_transforms()
    poses = np.concatenate([space.unit_m * translations[:, 0], rotations[:, 0]], axis=-1)
    return mirror_poses(poses) if space.mirrored else poses


def _hand(ordered: _Ordered, frames: int, side: Side, hand: Hand, space: _Space) -> tuple[Array, Array]:
    """World joints and bone rotations; the fingertips, which the files lack, are those of `hand`."""
    bones = hand.bone_count
    translations, local = space.points(ordered[0][:frames]), space.quats(ordered[1][:frames])
    tips = hand.offsets[bones:] if side == "right" else mirror_points(hand.offsets[bones:])
    positions = np.empty((frames, hand.joint_count, 3))
    world = np.empty((frames, bones, 4))
    positions[:, 0], world[:, 0] = translations[:, 0], local[:, 0]
    for j, parent in enumerate(hand.parents[1:], start=1):
        offset = translations[:, j] if j < bones else tips[j - bones]
        positions[:, j] = positions[:, parent] + quat_rotate(world[:, parent], offset)
        if j < bones:
            world[:, j] = quat_multiply(world[:, parent], local[:, j])
    return positions, world
