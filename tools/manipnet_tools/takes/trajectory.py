"""Reads trajectory texts, the format of the ManipNet dataset's motions without fingers.

The first line is the rate in hertz. Every other line has 21 numbers: object, left wrist and right wrist, each as a
quaternion x y z w and a position in left-handed decimetres. The object's position is the centre of its bounding box.
"""

from pathlib import Path

import numpy as np

from manipnet.geometry import Array, mirror_poses, quat_normalize
from manipnet_tools.takes.text_file import read_text

DECIMETRE_M = 0.1
"""The unit of length in the files of the dataset."""
BODIES = ("object", "left_wrist", "right_wrist")
COLUMNS = 7 * len(BODIES)


class TrajectoryError(ValueError):
    """A trajectory text cannot be read; the message names the file, the place and what was expected."""


def read_trajectory(path: Path) -> tuple[float, dict[str, Array]]:
    """Rate in hertz and poses `(T, 7)` by `BODIES`, in the project frame. Raises `TrajectoryError`."""
    try:
        lines = read_text(path).splitlines()
    except OSError as error:
        raise TrajectoryError(f"{path}: cannot be read ({error})") from None
    rate_hz = _rate(lines[0] if lines else "", path)
    rows = [_row(line, f"{path}:{number}") for number, line in enumerate(lines[1:], start=2) if line.strip()]
    if not rows:
        raise TrajectoryError(f"{path}: has no frames; every line after the first must be a frame")
    values = np.array(rows).reshape(len(rows), len(BODIES), 7)
    poses = {
        name: np.concatenate([DECIMETRE_M * values[:, i, 4:], values[:, i, :4]], 1) for i, name in enumerate(BODIES)
    }
    if lost := [name for name, track in poses.items() if np.linalg.norm(track[:, 3:], axis=1).min() < 1e-6]:
        raise TrajectoryError(f"{path}: {lost[0]} has a zero quaternion; a trajectory text has no lost frames")
    return rate_hz, {name: _project(track) for name, track in poses.items()}


def _project(poses: Array) -> Array:
    return mirror_poses(np.concatenate([poses[:, :3], quat_normalize(poses[:, 3:])], axis=1))


def _rate(line: str, path: Path) -> float:
    try:
        rate_hz = float(line)
    except ValueError:
        rate_hz = 0.0
    if not 1.0 <= rate_hz <= 1000.0:
        raise TrajectoryError(
            f"{path}:1: {line[:40]!r} is not a rate; the first line must be a rate of 1 to 1000 Hz, for example 120"
        )
    return rate_hz


def _row(line: str, where: str) -> list[float]:
    cells = line.split(",")
    if len(cells) != COLUMNS:
        raise TrajectoryError(f"{where}: {len(cells)} values; a frame must have {COLUMNS}, separated by commas")
    try:
        row = [float(cell) for cell in cells]
    except ValueError as error:
        raise TrajectoryError(f"{where}: {error}") from None
    if not np.isfinite(row).all():
        raise TrajectoryError(f"{where}: a value is not finite")
    return row
