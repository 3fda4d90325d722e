"""The table in a CSV export of Motive: which columns belong to which body, and their numbers.

Above the line `Frame,Time,…`, the head has one row each for the type, the name and, from version to version, the ID and
the parent of a column, then `Rotation` or `Position`; the component stands in the line `Frame,Time,…` itself. Before
Motive 2 the second column of these rows was empty; since then it says `Type`, `Name`, `ID` and `Parent`. A spreadsheet
may have saved the file with semicolons or tabs between the cells, and with decimal commas. With timecode, the column of
the time, or one more, holds HH:MM:SS:FF.
"""

import csv
import logging
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import numpy as np

from manipnet.geometry import Array
from manipnet.wire.timecode import is_timecode

TYPES: Final = ("rigid body", "bone")
PARTS: Final = ("Rotation", "Position")
OPTIONS: Final = (
    *("Capture Frame Rate", "Export Frame Rate", "Total Exported Frames"),
    *("Rotation Type", "Length Units", "Coordinate Space"),
)
"""The keys of the first line that matter; an operator's notes with commas may stand between them."""
LARGEST: Final = 1e12
"""Motive never writes a number this large."""
_FIRST_LINE: Final = re.compile(r'\s*"?Format Version"?\s*([,;\t])')
_log = logging.getLogger(__name__)


class MotiveCsvError(ValueError):
    """A CSV file is not a usable export of Motive; the text names the file, the place and the remedy."""


@dataclass(frozen=True)
class Columns:
    """The columns of one body, by component. In a `Table` they are columns of its `values`."""

    rotation: dict[str, int] = field(default_factory=dict)
    position: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Table:
    """The options in the first line, and for each of T frames its number, its time and the cells of all bodies."""

    options: dict[str, str]
    bodies: dict[str, Columns]
    """Rigid bodies, then bones."""
    frames: Array
    """`(T,)`, rising."""
    times_s: Array
    """`(T,)`, rounded; NaN where a time is missing."""
    values: Array
    """`(T, C)`; NaN for an empty cell."""
    timecodes: tuple[str, ...] = ()
    """HH:MM:SS:FF of each frame, or "" where there is none; empty for a file without timecode."""


def read_table(text: str, where: str) -> Table:
    """The table in the text of a file called `where` in warnings. Raises `MotiveCsvError`."""
    separator, decimal_commas = _separators(text)
    try:
        lines = list(csv.reader(text.splitlines(), delimiter=separator))
    except csv.Error as error:
        raise MotiveCsvError(f"is not a table ({error}); export the take again") from None
    options = {
        key: value.replace(",", ".") if decimal_commas and _is_number(value) else value
        for key, value in pairwise(map(str.strip, lines[0]))
        if key in OPTIONS
    }
    first = next((i for i, line in enumerate(lines) if line and line[0].strip().lower() == "frame"), None)
    if first is None:
        raise MotiveCsvError("has no line that begins with Frame; turn on Header Information when exporting")
    head = [line for line in lines[1:first] if any(map(str.strip, line))]
    body = list(_rows(lines[first + 1 :], first + 2, len(lines[first]), where, text.endswith("\n")))
    _check_widths([cells for _, cells in body], len(lines[first]), separator)
    bodies = _bodies(head, lines[first], where)
    columns = sorted(
        {column for body in bodies.values() for part in (body.rotation, body.position) for column in part.values()}
    )
    numbers = np.array([[_number(cells, c, line, decimal_commas) for c in (0, *columns)] for line, cells in body])
    frames = numbers[:, 0] if len(numbers) else np.empty(0)
    if not len(frames) or np.isnan(frames).any() or (np.diff(frames) <= 0.0).any():
        raise MotiveCsvError("every line of the table must start with a frame number greater than the one before")
    times_s = np.array([_time(cells, decimal_commas) for _, cells in body])
    place = {column: i for i, column in enumerate(columns)}
    placed = {
        name: Columns(_placed(body.rotation, place), _placed(body.position, place)) for name, body in bodies.items()
    }
    timecodes = _timecodes(lines[first], [cells for _, cells in body])
    return Table(options, placed, frames, times_s, numbers[:, 1:], timecodes)


def _separators(text: str) -> tuple[str, bool]:
    """What separates the cells, and whether the numbers have decimal commas."""
    found = _FIRST_LINE.match(text)
    if found is None:
        raise MotiveCsvError(
            "is not a CSV export of Motive, whose first line starts with Format Version; "
            "turn on Header Information when exporting"
        )
    separator = found[1]
    return separator, separator != ","


def _rows(
    lines: list[list[str]], number: int, width: int, where: str, ends_with_a_line: bool
) -> Iterator[tuple[int, list[str]]]:
    """The lines that are not empty, with their numbers; a last line that was cut off is left out."""
    for line_number, cells in enumerate(lines, start=number):
        if line_number == number + len(lines) - 1 and not ends_with_a_line and 0 < len(cells) < width:
            _log.warning("%s: ends in the middle of line %d, which is left out", where, line_number)
        elif any(map(str.strip, cells)):
            yield line_number, cells


def _check_widths(rows: list[list[str]], width: int, separator: str) -> None:
    """Raise `MotiveCsvError` if decimal commas have cut the numbers into two cells each."""
    filled = [
        len(cells) - next((i for i, cell in enumerate(reversed(cells)) if cell.strip()), 0) for cells in rows[:50]
    ]
    if separator == "," and filled and float(np.median(filled)) > 1.3 * width:
        raise MotiveCsvError(
            f"has {int(np.median(filled))} cells in a line under {width} columns: its numbers have decimal commas, "
            "which look like the commas between cells; export it with decimal points, or with semicolons between cells"
        )


def _bodies(head: list[list[str]], components: list[str], where: str) -> dict[str, Columns]:
    """The columns of every body. Bodies without rotation or position are left out with a warning."""
    types, names, ids = _head_rows(head)
    parts = [cell.strip() for cell in head[-1]] if head else []
    found: dict[tuple[str, str], dict[str, Columns]] = {}
    for column, (kind, part, component) in enumerate(zip(types, parts, components, strict=False)):
        kind, name = kind.strip().lower(), names[column].strip() if column < len(names) else ""
        if kind not in TYPES or part not in PARTS or not name:
            continue
        identity = ids[column].strip() if column < len(ids) else ""
        body = found.setdefault((kind, name), {}).setdefault(identity, Columns())
        cells = body.rotation if part == "Rotation" else body.position
        if component.strip() in cells:
            raise MotiveCsvError(f"two bodies are called {name!r}; rename one in Motive and export again")
        cells[component.strip()] = column
    for (_, name), same in found.items():
        if len(same) > 1:
            raise MotiveCsvError(
                f"two bodies are called {name!r} (IDs {' and '.join(same)}); rename one in Motive and export again"
            )
    if twice := {name for kind, name in found if kind == "bone"} & {name for kind, name in found if kind != "bone"}:
        raise MotiveCsvError(f"a rigid body and a bone are called {min(twice)!r}; rename one and export again")
    ordered = sorted(found, key=lambda key: TYPES.index(key[0]))
    bodies = {name: next(iter(found[kind, name].values())) for kind, name in ordered}
    whole = {name: body for name, body in bodies.items() if body.rotation and body.position.keys() == set("XYZ")}
    if not whole:
        kinds = ", ".join(sorted({kind.strip() for kind in types[2:] if kind.strip()})) or "nothing"
        raise MotiveCsvError(
            f"has no rigid body or bone with rotation and position, only {kinds}; "
            "turn on Rigid Bodies or Bones, with rotation and position, when exporting"
        )
    if partial := bodies.keys() - whole.keys():
        _log.warning(
            "%s: these bodies are left out because they lack rotation or position: %s",
            where,
            ", ".join(sorted(partial)),
        )
    return whole


def _head_rows(head: list[list[str]]) -> tuple[list[str], list[str], list[str]]:
    """The rows with the types, names and IDs of the columns, by their labels or else by their order."""
    labelled = {line[1].strip().lower(): line for line in head if len(line) > 1 and line[1].strip()}
    if "type" in labelled:
        return labelled["type"], labelled.get("name", []), labelled.get("id", [])
    rows = [line for line in head[:-1] if not (len(line) > 1 and line[1].strip())]
    start = next((i for i, line in enumerate(rows) if _has_type(line)), None)
    if start is None or start + 1 >= len(rows):
        raise MotiveCsvError("has no rows with the types and names of its columns; turn on Header Information")
    return rows[start], rows[start + 1], rows[start + 2] if start + 2 < len(rows) else []


def _has_type(line: list[str]) -> bool:
    known = {cell.strip().lower() for cell in line}
    return bool(known & {*TYPES, "marker", "rigid body marker", "bone marker"})


def _number(cells: list[str], column: int, line: int, decimal_commas: bool) -> float:
    text = cells[column].strip() if column < len(cells) else ""
    if not text:
        return np.nan
    try:
        value = float(text.replace(",", ".") if decimal_commas else text)
    except ValueError:
        value = np.inf
    if abs(value) >= LARGEST:
        raise MotiveCsvError(f"line {line}, cell {column + 1}: {text!r} is not a number")
    return value


def _time(cells: list[str], decimal_commas: bool) -> float:
    try:
        return _number(cells, 1, 0, decimal_commas)
    except MotiveCsvError:
        return np.nan


def _timecodes(components: list[str], rows: list[list[str]]) -> tuple[str, ...]:
    """The timecode of each row, from a column called Timecode, or from a time column that holds timecode.

    What follows the frame number after a point is the number of a subframe, which is left out.
    """
    named = [c for c, cell in enumerate(components) if cell.replace(" ", "").strip().lower().startswith("timecode")]
    for column in (*named, 1):
        cells = [cells[column].strip().partition(".")[0] if column < len(cells) else "" for cells in rows]
        texts = tuple(cell if is_timecode(cell) else "" for cell in cells)
        if any(texts):
            return texts
    return ()


def _placed(columns: dict[str, int], place: dict[int, int]) -> dict[str, int]:
    return {component: place[column] for component, column in columns.items()}


def _is_number(text: str) -> bool:
    return bool(re.fullmatch(r"\s*[-+]?\d+,\d+\s*", text))
