"""Reads takes in tables of joints, as gloves write them: one line a frame, and three columns for each joint.

The first line names the columns: `time` in seconds, and `<joint>_x`, `<joint>_y`, `<joint>_z` with any name by which a
joint is recognised, such as `LeftIndexProximal_x`. Seven columns `<object>_x … _z, _qx, _qy, _qz, _qw` hold the pose of
an object. An empty cell means that a joint was lost. Other columns are ignored.
"""

import csv
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Final

import numpy as np

from manipnet.geometry import SIDES, Array, Side
from manipnet.synthesis.hand.hand import Hand
from manipnet_tools.importing.joint_names import recognised, require_palm
from manipnet_tools.importing.source import JOINT_COUNT, ImportingError, SourceTake
from manipnet_tools.importing.space import find_space
from manipnet_tools.takes.text_file import read_text

_COLUMN: Final = re.compile(
    r"(.+?)[\s._:-]+(?:(pos|position|translation|rot|rotation|quat|quaternion)[\s._:-]+)?(q?[xyz]|q?w)$", re.IGNORECASE
)
_TIMES: Final = ("time", "t", "timestamp", "time_s", "time (seconds)", "seconds")
_POSE: Final = ("x", "y", "z", "qx", "qy", "qz", "qw")
LARGEST: Final = 1e12
"""A cell with a number as large as this holds no measurement."""
RATES_HZ: Final = (10.0, 1000.0)


def csv_take_files(path: Path) -> dict[str, Path]:
    """The files of takes, by name: `path` itself, or those in this folder. Raises `ImportingError`."""
    files = sorted(path.rglob("*")) if path.is_dir() else [path]
    takes = {
        file.stem if file == path else file.relative_to(path).with_suffix("").as_posix(): file
        for file in files
        if file.suffix.lower() == ".csv" and file.is_file()
    }
    if not takes:
        raise ImportingError(f"{path}: holds no CSV files")
    return takes


def read_csv_take(name: str, path: Path, hand: Hand) -> SourceTake:
    """Read the take in a file. Raises `ImportingError`."""
    try:
        text = read_text(path)
    except OSError as error:
        raise ImportingError(f"{path}: cannot be read ({error})") from None
    head = text.partition("\n")[0]
    separator = max(",;\t", key=head.count)
    try:
        lines = list(csv.reader(text.splitlines(), delimiter=separator))
    except csv.Error as error:
        raise ImportingError(f"{path}: is not a table ({error})") from None
    columns = [cell.strip() for cell in lines[0]] if lines else []
    numbers = _numbers(lines[1:], len(columns), separator != ",", path)
    rate_hz, numbers = _at_one_rate(columns, numbers, path)
    parts = _parts(columns, path)
    hands = _hands(parts, numbers, path)
    objects = {
        name: numbers[:, [part[axis] for axis in _POSE]] for name, part in parts.items() if part.keys() >= set(_POSE)
    }
    space = find_space(hands, hand)
    return SourceTake(
        name,
        rate_hz,
        {side: space.points(joints) for side, joints in hands.items()},
        {name: space.poses(poses) for name, poses in objects.items()},
    )


def _parts(columns: list[str], path: Path) -> dict[str, dict[str, int]]:
    """The columns of every joint and object, by component. Raises `ImportingError` for two of one name."""
    if twice := [column for column in columns if column and columns.count(column) > 1]:
        raise ImportingError(f"{path}: two columns are called {twice[0]!r}; rename one")
    parts: dict[str, dict[str, int]] = {}
    for number, column in enumerate(columns):
        if (found := _COLUMN.match(column)) is not None:
            axis = found[3].lower()
            is_turn = found[2] is not None and found[2].lower().startswith(("rot", "quat")) and not axis.startswith("q")
            parts.setdefault(found[1].strip(), {})[f"q{axis}" if is_turn else axis] = number
    return parts


def _hands(parts: dict[str, dict[str, int]], numbers: Array, path: Path) -> dict[Side, Array]:
    hands: dict[Side, Array] = {side: np.full((len(numbers), JOINT_COUNT, 3), np.nan) for side in SIDES}
    owners: dict[tuple[Side, int], str] = {}
    for name, (side, joint) in recognised(_with_places(parts)).items():
        if side is None:
            raise ImportingError(f"{path}: {name!r} does not say whether it is left or right")
        if (side, joint) in owners:
            raise ImportingError(f"{path}: {owners[side, joint]!r} and {name!r} are the same joint of the {side} hand")
        owners[side, joint] = name
        hands[side][:, joint] = numbers[:, [parts[name][axis] for axis in "xyz"]]
    found: dict[Side, Array] = {
        side: joints for side, joints in hands.items() if any(owner == side for owner, _ in owners)
    }
    for side in found:
        require_palm(side, {joint: name for (owner, joint), name in owners.items() if owner == side}, str(path))
    if not found:
        raise ImportingError(f"{path}: no column belongs to a joint of a hand, such as LeftIndexProximal_x")
    return found


def _with_places(parts: dict[str, dict[str, int]]) -> Iterable[str]:
    return (name for name, part in parts.items() if part.keys() >= {"x", "y", "z"})


def _numbers(lines: list[list[str]], width: int, decimal_commas: bool, path: Path) -> Array:
    """All cells `(T, width)`; a cell that does not hold a number is NaN."""
    rows = [[_number(cell, decimal_commas) for cell in [*line, *[""] * width][:width]] for line in lines if any(line)]
    if len(rows) < 2:
        raise ImportingError(f"{path}: holds fewer than two frames")
    return np.array(rows)


def _number(cell: str, decimal_commas: bool) -> float:
    try:
        value = float(cell.replace(",", ".") if decimal_commas else cell)
    except ValueError:
        return np.nan
    return value if abs(value) < LARGEST else np.nan


def _at_one_rate(columns: list[str], numbers: Array, path: Path) -> tuple[float, Array]:
    """The rate by the column of times, and the lines at that rate, with NaN where one is missing.

    Raises `ImportingError`.
    """
    column = next((i for i, name in enumerate(columns) if name.lower() in _TIMES), None)
    if column is None:
        raise ImportingError(f"{path}: has no column time with the seconds of each frame")
    times_s = numbers[:, column]
    steps_s = np.diff(times_s)
    step_s = float(np.median(steps_s)) if np.isfinite(steps_s).all() else 0.0
    if not RATES_HZ[0] <= 1.0 / max(step_s, 1e-9) <= RATES_HZ[1] or (steps_s <= 0.0).any():
        raise ImportingError(f"{path}: the times must rise in seconds by 0.001 to 0.1 a frame; they rise by {step_s:g}")
    frames = np.round((times_s - times_s[0]) / step_s).astype(np.int64)
    if frames[-1] > 10 * len(frames):
        raise ImportingError(f"{path}: most of its frames are missing between {times_s[0]:g} and {times_s[-1]:g} s")
    filled = np.full((int(frames[-1]) + 1, numbers.shape[1]), np.nan)
    filled[frames] = numbers
    return round(1.0 / step_s, 3), filled
