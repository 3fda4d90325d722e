"""Reads the list of frames that Tracking Tools and the first versions of Motive export as CSV (format 1.1 and before).

Every line begins with its kind. `rigidbody,<name>,<id>,…` defines a body, and `frame,<number>,<seconds>,<bodies>,…`
holds for each body that was tracked its ID, x y z, the quaternion x y z w and three angles, in metres. A number with #
was not measured. Such a file has no rate, so the rate is that of the times.
"""

import csv

import numpy as np

from manipnet_tools.takes.motive_table import LARGEST, Columns, MotiveCsvError, Table

_BODY_CELLS = 11
_QUATERNION, _POSITION = "XYZW", "XYZ"


def read_frames(text: str) -> Table:
    """The bodies in the text of such a file, as if it were the table of a later version. Raises `MotiveCsvError`."""
    names: dict[str, str] = {}
    frames: list[tuple[float, float, dict[str, list[float]]]] = []
    for number, line in enumerate(csv.reader(text.splitlines()), start=1):
        kind = line[0].strip().lower() if line else ""
        if kind == "lefthanded":
            raise MotiveCsvError("is left-handed; export it right-handed")
        if kind in ("rigidbody", "trackable") and not frames and len(line) > 2:
            if line[1].strip() in names.values():
                raise MotiveCsvError(f"two bodies are called {line[1].strip()!r}; rename one and export again")
            names[line[2].strip()] = line[1].strip()
        elif kind == "frame":
            try:
                frames.append(_frame(line))
            except (ValueError, IndexError) as error:
                raise MotiveCsvError(f"line {number}: is not a frame ({error})") from None
    if len(frames) < 2 or not names:
        raise MotiveCsvError("has no rigid bodies or fewer than two frames; turn on both when exporting")
    numbers, times_s = (np.array(column) for column in zip(*[frame[:2] for frame in frames], strict=True))
    if (np.diff(numbers) <= 0.0).any() or (np.diff(times_s) <= 0.0).any():
        raise MotiveCsvError("the numbers and times of its frames must rise")
    values = np.full((len(frames), 7 * len(names)), np.nan)
    for row, (_, _, bodies) in zip(values, frames, strict=True):
        for place, identity in enumerate(names):
            row[7 * place : 7 * place + 7] = bodies.get(identity, np.nan)
    rate_hz = round(float(np.ptp(numbers) / np.ptp(times_s)), 3)
    bodies = {name: _columns(7 * place) for place, name in enumerate(names.values())}
    return Table({"Export Frame Rate": f"{rate_hz}"}, bodies, numbers, times_s, values)


def _frame(line: list[str]) -> tuple[float, float, dict[str, list[float]]]:
    """Number, seconds, and of each tracked body the quaternion and the position, by its ID."""
    bodies = {}
    for start in range(4, 4 + _BODY_CELLS * int(line[3]), _BODY_CELLS):
        identity, *cells = line[start : start + 8]
        if len(cells) < 7:
            raise ValueError(f"it announces {line[3].strip()} bodies but ends in the middle of one")
        if not any("#" in cell for cell in cells):
            x, y, z, *turn = (_number(cell) for cell in cells)
            bodies[identity.strip()] = [*turn, x, y, z]
    return _number(line[1]), _number(line[2]), bodies


def _number(cell: str) -> float:
    value = float(cell)
    if not abs(value) < LARGEST:
        raise ValueError(f"{cell.strip()!r} is not a number")
    return value


def _columns(first: int) -> Columns:
    turn = {axis: first + i for i, axis in enumerate(_QUATERNION)}
    return Columns(turn, {axis: first + 4 + i for i, axis in enumerate(_POSITION)})
