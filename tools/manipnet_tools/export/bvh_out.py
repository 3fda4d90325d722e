"""Writes hands and objects as BVH: with the skeleton and layout of the dataset, or right-handed for other programs."""

import warnings
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from manipnet.geometry import Array, mirror_points, mirror_quats
from manipnet.synthesis.hand.hand import Hand
from manipnet_tools.export.animation import Animation, ExportError, HandTrack
from manipnet_tools.takes.trajectory import DECIMETRE_M

CENTIMETRES_PER_M = 100.0
_CHANNELS = "Yrotation Xrotation Zrotation"
_ROOT_CHANNELS = f"CHANNELS 6 Xposition Yposition Zposition {_CHANNELS}"


def write_bvh(animation: Animation, folder: Path, right_handed: bool = False, replace: bool = False) -> list[Path]:
    """Write `leftHand.bvh`, `rightHand.bvh` and `<object>.bvh` into `folder`; returns the files.

    By default the files are left-handed and in decimetres, like the dataset's, and every tool here reads them. With
    `right_handed` they are in centimetres, as Blender and Maya expect; no tool here reads those. Raises `ExportError`
    if the folder already contains BVH files, unless they are to be replaced.
    """
    new_folder(folder, replace)
    space = Space(CENTIMETRES_PER_M, False) if right_handed else Space(1.0 / DECIMETRE_M, True)
    texts = {f"{side}Hand": _hand_text(hand, animation.rate_hz, space) for side, hand in animation.hands.items()}
    texts |= object_texts(animation, space)
    for stem, text in texts.items():
        (folder / f"{stem}.bvh").write_text(text, encoding="utf-8")
    return [folder / f"{stem}.bvh" for stem in texts]


def new_folder(folder: Path, replace: bool = False) -> None:
    """Make a folder for files. Raises `ExportError` if it already contains BVH files that are not to be replaced."""
    if not replace and any(folder.glob("*.bvh")):
        raise ExportError(f"{folder}: already contains BVH files, which may be a take; give a new folder")
    folder.mkdir(parents=True, exist_ok=True)


def object_texts(animation: Animation, space: "Space") -> dict[str, str]:
    """The files of the objects, by stem."""
    stems = {file_stem(name): body for name, body in animation.objects.items()}
    return {stem: _object_text(stem, body.poses, animation.rate_hz, space) for stem, body in stems.items()}


def file_stem(name: str) -> str:
    """A body's name as a file name and a joint name without spaces."""
    return "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in name)


class Space:
    """The units and handedness of a file."""

    def __init__(self, per_m: float, mirrored: bool) -> None:
        self._per_m, self._mirrored = per_m, mirrored

    def points(self, points: Array) -> Array:
        return self._per_m * (mirror_points(points) if self._mirrored else points)

    def text(self, point: Array) -> str:
        return _numbers(self.points(point))

    def degrees(self, quats: Array) -> Array:
        """Intrinsic Euler angles `(T, ..., 3)` in the order Y, X, Z, unwrapped so that they never jump by 360°."""
        quats = mirror_quats(quats) if self._mirrored else quats
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # about gimbal lock, where one of many solutions is chosen
            angles = Rotation.from_quat(quats.reshape(-1, 4)).as_euler("YXZ", degrees=True)
        return np.unwrap(angles.reshape(*quats.shape[:-1], 3), period=360.0, axis=0)


def _hand_text(hand: HandTrack, rate_hz: float, space: Space) -> str:
    offsets = space.points(hand.offsets)
    columns = [space.points(hand.wrist[:, :3]), space.degrees(hand.rotations).reshape(len(hand.wrist), -1)]
    return "\n".join(
        ["HIERARCHY", *_joint(hand.model, 0, offsets, ""), *motion_lines(np.concatenate(columns, axis=1), rate_hz)]
    )


def _joint(model: Hand, joint: int, offsets: Array, indent: str) -> list[str]:
    """The lines of a joint and its descendants; a hand's joints are in depth-first order, as the format requires."""
    if joint >= model.bone_count:
        head, channels = f"{indent}End Site", []
    elif joint == 0:
        head, channels = f"ROOT {model.joint_names[0]}", [f"\t{_ROOT_CHANNELS}"]
    else:
        head, channels = f"{indent}JOINT {model.joint_names[joint]}", [f"{indent}\tCHANNELS 3 {_CHANNELS}"]
    below = [
        line
        for child in np.flatnonzero(joint == model.parents)
        for line in _joint(model, int(child), offsets, f"{indent}\t")
    ]
    return [head, f"{indent}{{", f"{indent}\tOFFSET {_numbers(offsets[joint])}", *channels, *below, f"{indent}}}"]


def _object_text(name: str, poses: Array, rate_hz: float, space: Space) -> str:
    end = ["\tEnd Site", "\t{", "\t\tOFFSET 0 0 0", "\t}"]
    columns = np.concatenate([space.points(poses[:, :3]), space.degrees(poses[:, 3:])], axis=1)
    head = ["HIERARCHY", f"ROOT {name}", "{", "\tOFFSET 0 0 0", f"\t{_ROOT_CHANNELS}", *end, "}"]
    return "\n".join([*head, *motion_lines(columns, rate_hz)])


def motion_lines(columns: Array, rate_hz: float) -> list[str]:
    """The motion section of a file whose channels are `columns (T, C)`."""
    rows = [_numbers(row) for row in columns]
    return ["MOTION", f"Frames: {len(rows)}", f"Frame Time: {1.0 / rate_hz:.9f}", *rows, ""]


def _numbers(values: Array) -> str:
    return " ".join(f"{value:.6f}" for value in values.tolist())
