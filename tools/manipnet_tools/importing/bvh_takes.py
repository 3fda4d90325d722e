"""Reads takes in BVH from gloves and animation programs, with any skeleton that has hands.

A folder is a take, or holds folders that are. Its files with hands are the hands: one file for both, or one for each.
Every other file is an object, which its root moves, called after the file. Units and handedness are those in which the
hands are hands.
"""

from pathlib import Path

import numpy as np

from manipnet.geometry import SIDES, Array, Side, quat_multiply, quat_rotate
from manipnet.synthesis.hand.hand import Hand
from manipnet_tools.importing.joint_names import recognised, require_palm
from manipnet_tools.importing.source import JOINT_COUNT, ImportingError, SourceTake
from manipnet_tools.importing.space import find_space
from manipnet_tools.takes.bvh_folder import SPARE_FRAMES, bvh_files
from manipnet_tools.takes.bvh_motion import BvhError, BvhMotion, read_bvh


def bvh_take_folders(folder: Path) -> dict[str, Path]:
    """The folders of takes, by name. Raises `ImportingError`."""
    places = [folder, *sorted(path for path in folder.rglob("*") if path.is_dir())] if folder.is_dir() else []
    takes = {
        place.name if place == folder else place.relative_to(folder).as_posix(): place
        for place in places
        if bvh_files(place)
    }
    if not takes:
        raise ImportingError(f"{folder}: holds no BVH files; a take is a folder with those of its hands and objects")
    return takes


def read_bvh_take(name: str, folder: Path, hand: Hand) -> SourceTake:
    """Read the take in a folder. Raises `ImportingError`."""
    hands: dict[Side, Array] = {}
    objects: dict[str, Array] = {}
    motions: list[BvhMotion] = []
    for path in bvh_files(folder):
        try:
            motion = read_bvh(path)
        except BvhError as error:
            raise ImportingError(str(error)) from None
        motions.append(motion)
        found = hand_joints(motion, str(path), side_of(path.stem))
        if twice := found.keys() & hands.keys():
            raise ImportingError(f"{path}: the {min(twice)} hand is in another file of {folder} already")
        if found:
            hands |= found
        else:
            objects[path.stem] = root_poses(motion)
    if not hands:
        raise ImportingError(f"{folder}: none of its files has the wrist and knuckles of a hand")
    lengths, rates = {len(m.motion) for m in motions}, {m.rate_hz for m in motions}
    if max(lengths) - min(lengths) > SPARE_FRAMES or max(rates) - min(rates) > 0.01 * max(rates):
        raise ImportingError(
            f"{folder}: its files have {sorted(lengths)} frames at {sorted(rates)} Hz; they must be alike"
        )
    frames, space = min(lengths), find_space(hands, hand)
    return SourceTake(
        name,
        motions[0].rate_hz,
        {side: space.points(joints[:frames]) for side, joints in hands.items()},
        {stem: space.poses(poses[:frames]) for stem, poses in objects.items()},
    )


def side_of(name: str) -> Side | None:
    """The side that a file is called after."""
    words = recognised([f"{name} wrist"]).values()
    return next((side for side, _ in words), None)


def hand_joints(motion: BvhMotion, where: str, default: Side | None) -> dict[Side, Array]:
    """The hands in a motion, `(T, 21, 3)` in the file's own lengths; `default` is the side of joints without one.

    Raises `ImportingError` for joints of one name and for hands that lack a knuckle.
    """
    names = [joint.name for joint in motion.joints]
    joints: dict[Side, Array] = {side: np.full((len(motion.motion), JOINT_COUNT, 3), np.nan) for side in SIDES}
    owners: dict[tuple[Side, int], str] = {}
    positions, ends = _world(motion)
    for name, (named, number) in recognised(names).items():
        side = named or default
        if side is None:
            continue
        if (side, number) in owners:
            raise ImportingError(
                f"{where}: {owners[side, number]!r} and {name!r} are the same joint of the {side} hand"
            )
        owners[side, number] = name
        j = names.index(name)
        joints[side][:, number] = positions[:, j]
        if number and (number - 1) % 4 == 2 and motion.joints[j].end is not None and (side, number + 1) not in owners:
            joints[side][:, number + 1] = ends[:, j]
    found = {side: {number for owner, number in owners if owner == side} for side in SIDES}
    hands: list[Side] = [side for side in SIDES if len(found[side]) > 3]
    for side in hands:
        require_palm(side, {number: owners[side, number] for number in found[side]}, where)
    return {side: joints[side] for side in hands}


def root_poses(motion: BvhMotion) -> Array:
    """Poses `(T, 7)` of the root in the file's own lengths."""
    translations, rotations = motion.local_transforms()
    return np.concatenate([translations[:, 0], rotations[:, 0]], axis=1)


def _world(motion: BvhMotion) -> tuple[Array, Array]:
    """Positions of all joints `(T, J, 3)`, and of the End Sites of those that have one."""
    translations, rotations = motion.local_transforms()
    positions, turns, ends = translations.copy(), rotations.copy(), np.full_like(translations, np.nan)
    for j, joint in enumerate(motion.joints):
        if joint.parent >= 0:
            positions[:, j] = positions[:, joint.parent] + quat_rotate(turns[:, joint.parent], translations[:, j])
            turns[:, j] = quat_multiply(turns[:, joint.parent], rotations[:, j])
        if joint.end is not None and np.any(joint.end):
            ends[:, j] = positions[:, j] + quat_rotate(turns[:, j], np.array(joint.end))
    return positions, ends
