"""Reads the rigid bodies of a take that OptiTrack Motive exported as CSV.

The first line holds pairs of a key and a value. The head of the table starts at the line `,Type,…`: Type, Name, ID,
perhaps Parent, then Rotation or Position, then the component. An empty cell means that a body was lost in that frame.
The time column is rounded to a millisecond, so times are computed as frame ÷ rate.
Source: docs.optitrack.com, "Data Export: CSV".
"""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

UNITS_M = {"meters": 1.0, "centimeters": 0.01, "millimeters": 0.001}
EULER_ORDERS = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")
QUATERNION = "XYZW"
UNTRACKED = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


class MotiveCsvError(ValueError):
    """A CSV file is not a usable Motive export; the text names the file, the place and the remedy."""


@dataclass(frozen=True)
class MotiveCsv:
    """Poses `(T, 7)` in metres and whether they were tracked `(T,)`, by rigid body; `time_s (T,)` from the start."""

    rate_hz: float
    time_s: Array
    bodies: dict[str, tuple[Array, NDArray[np.bool_]]]


@dataclass(frozen=True)
class _Body:
    """The columns of one rigid body, by component."""

    rotation: dict[str, int]
    position: dict[str, int]


def read_motive_csv(path: Path) -> MotiveCsv:
    """Read an export with rigid bodies. Raises `MotiveCsvError`."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = list(csv.reader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        remedy = "; save it as UTF-8" if isinstance(error, UnicodeDecodeError) else ""
        raise MotiveCsvError(f"{path}: cannot be read ({error}){remedy}") from None
    try:
        return _parse(lines)
    except MotiveCsvError as error:
        raise MotiveCsvError(f"{path}: {error}") from None


def _parse(lines: list[list[str]]) -> MotiveCsv:
    options = dict(zip(lines[0][::2], lines[0][1::2], strict=False)) if lines else {}
    head = next((i for i, line in enumerate(lines) if line[1:2] == ["Type"]), None)
    first = next((i for i, line in enumerate(lines) if line[:1] == ["Frame"]), None)
    if "Format Version" not in options or head is None or first is None or first < head:
        raise MotiveCsvError("is not a CSV export of Motive; turn on Header Information when exporting")
    rate_hz = _rate(options)
    scale, rotation = _choice(options, "Length Units", UNITS_M), options.get("Rotation Type", "Quaternion")
    if options.get("Coordinate Space", "Global") != "Global":
        raise MotiveCsvError(f"Coordinate Space is {options['Coordinate Space']}; export it as Global")
    bodies = _bodies(lines[head : first + 1])
    numbers, values = _values(lines[first + 1 :], first + 2, len(lines[head]))
    return MotiveCsv(
        rate_hz,
        (numbers - numbers[0]) / rate_hz,
        {name: _track(name, body, values, scale, rotation) for name, body in bodies.items()},
    )


def _rate(options: dict[str, str]) -> float:
    text = options.get("Export Frame Rate") or options.get("Capture Frame Rate") or ""
    try:
        rate_hz = float(text)
    except ValueError:
        rate_hz = 0.0
    if not 1.0 <= rate_hz <= 2000.0:
        raise MotiveCsvError(f"Export Frame Rate is {text!r}; it must be 1 to 2000 Hz")
    return rate_hz


def _choice(options: dict[str, str], key: str, allowed: dict[str, float]) -> float:
    value = options.get(key, "Meters").lower()
    if value not in allowed:
        raise MotiveCsvError(f"{key} is {options[key]!r}; allowed are {', '.join(allowed)}")
    return allowed[value]


def _bodies(head: list[list[str]]) -> dict[str, _Body]:
    rows = {line[1]: line for line in head[:-1] if len(line) > 1 and line[1]}
    kinds, components = head[-2], head[-1]
    types, names = rows["Type"], rows.get("Name", [])
    bodies: dict[str, _Body] = {}
    for column, (kind, part, component) in enumerate(zip(types, kinds, components, strict=False)):
        if kind == "Rigid Body" and part in ("Rotation", "Position") and column < len(names):
            body = bodies.setdefault(names[column], _Body({}, {}))
            (body.rotation if part == "Rotation" else body.position)[component] = column
    bodies = {name: body for name, body in bodies.items() if body.rotation and body.position.keys() == set("XYZ")}
    if not bodies:
        found = ", ".join(sorted(set(types[2:]))) or "nothing"
        raise MotiveCsvError(
            f"has no rigid body with rotation and position, only {found}; turn on Rigid Bodies when exporting"
        )
    return bodies


def _values(lines: list[list[str]], number: int, width: int) -> tuple[Array, Array]:
    """Frame numbers `(T,)` and all cells `(T, width)`, in which an empty cell is NaN."""
    rows = []
    for line_number, line in enumerate(lines, start=number):
        if not any(line):
            continue
        try:
            rows.append([float(cell) if cell else np.nan for cell in [*line, *[""] * width][:width]])
        except ValueError as error:
            raise MotiveCsvError(f"line {line_number}: {error}") from None
    if not rows or np.isnan(frames := np.array(rows)[:, 0]).any() or (np.diff(frames) <= 0.0).any():
        raise MotiveCsvError("every line of the table must start with a frame number greater than the one before")
    return frames, np.array(rows)


def _track(name: str, body: _Body, values: Array, scale: float, rotation: str) -> tuple[Array, NDArray[np.bool_]]:
    """Poses, and whether they were tracked; a lost body keeps its last pose, or has its first one before that."""
    positions = scale * values[:, [body.position[axis] for axis in "XYZ"]]
    if rotation == "Quaternion" and body.rotation.keys() == set(QUATERNION):
        quats = values[:, [body.rotation[axis] for axis in QUATERNION]]
        quats = np.where(np.linalg.norm(quats, axis=1, keepdims=True) > 1e-6, quats, np.nan)
    elif rotation in EULER_ORDERS and body.rotation.keys() == set("XYZ"):
        angles = values[:, [body.rotation[axis] for axis in rotation]]
        # Rotations are about the body's own axes, in the order of the name.
        quats = Rotation.from_euler(rotation, np.nan_to_num(angles), degrees=True).as_quat() + 0.0 * angles[:, :1]
    else:
        found = f"{'/'.join(body.rotation)} of the type {rotation}"
        raise MotiveCsvError(f"body {name!r} has rotations {found}; export Quaternion or XYZ")
    poses = np.concatenate([positions, quats], axis=1)
    tracked = np.asarray(np.isfinite(poses).all(axis=1))
    poses = poses[np.maximum.accumulate(np.where(tracked, np.arange(len(tracked)), np.argmax(tracked)))]
    if not tracked.any():
        poses[:] = UNTRACKED
    poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    return poses, tracked
