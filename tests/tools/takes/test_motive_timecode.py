"""The timecode in a CSV export of Motive goes into the take, and from there into replays."""

from pathlib import Path

import numpy as np
import pytest

from manipnet_tools.commands.replay import take_frames
from manipnet_tools.takes.take import Take, read_take

HZ, TIMECODE_HZ, FRAMES = 120, 30, 400
FIRST_LINE = (
    "Format Version,1.23,Capture Frame Rate,120.000000,Export Frame Rate,120.000000,"
    "Rotation Type,Quaternion,Length Units,Meters,Coordinate Space,Global"
)
NAMES = ("LeftWrist", "RightWrist", "Box")


def timecode(k: int, separator: str = ":") -> str:
    count = k * TIMECODE_HZ // HZ
    return f"10:59:{50 + count // TIMECODE_HZ:02d}{separator}{count % TIMECODE_HZ:02d}"


def export(tmp_path: Path, heads: list[str], cells_of, between: str = ",") -> Take:
    """An export whose first columns after the frame have the `heads`, and in frame k the cells `cells_of(k)`."""
    columns = [(name, part, axis) for name in NAMES for part, axes in PARTS for axis in axes]
    empty, width = [""] * len(heads), len(heads)
    rows = [
        [*["", "Type"][: 1 + width], *[""] * (width - 1), *["Rigid Body"] * len(columns)],
        [*["", "Name"][: 1 + width], *[""] * (width - 1), *[name for name, _, _ in columns]],
        [*["", "ID"][: 1 + width], *[""] * (width - 1), *[name + "1" for name, _, _ in columns]],
        ["", *empty, *[part for _, part, _ in columns]],
        ["Frame", *heads, *[axis for _, _, axis in columns]],
    ]
    rows += [[str(k), *cells_of(k), *["0", "0", "0", "1", f"{1e-3 * k:.3f}", "1", "0"] * 3] for k in range(FRAMES)]
    path = tmp_path / "take.csv"
    lines = [FIRST_LINE.replace(",", between), "", *[between.join(row) for row in rows]]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return read_take(path)


PARTS = (("Rotation", "XYZW"), ("Position", "XYZ"))
SECONDS = "Time (Seconds)"


@pytest.mark.parametrize(
    ("heads", "cells_of"),
    [
        (["Timecode"], lambda k: [timecode(k)]),
        ([SECONDS], lambda k: [timecode(k)]),
        ([SECONDS, "TimeCode"], lambda k: [f"{k / HZ:.3f}", timecode(k)]),
        ([SECONDS, "Time Code"], lambda k: [f"{k / HZ:.3f}", f" {timecode(k)}.{k % 4} "]),
    ],
)
@pytest.mark.parametrize("between", [",", ";"])
def test_the_timecode_of_each_frame_is_read(tmp_path: Path, heads, cells_of, between: str) -> None:
    take = export(tmp_path, heads, cells_of, between)
    assert take.timecode is not None
    assert list(take.timecode.texts) == [timecode(k) for k in range(FRAMES)]
    assert take.timecode.rate == TIMECODE_HZ
    assert take.rate_hz == HZ
    assert np.allclose(take.time_s, np.arange(FRAMES) / HZ)
    frames = list(take_frames(take))
    assert [frame.timecode for frame in frames] == [timecode(k) for k in range(FRAMES)]
    assert {frame.timecode_rate for frame in frames} == {TIMECODE_HZ}


def test_drop_frame_is_kept(tmp_path: Path) -> None:
    take = export(tmp_path, ["Timecode"], lambda k: [timecode(k, ";")])
    assert take.timecode is not None
    assert take.timecode.texts[5] == "10:59:50;01"


@pytest.mark.parametrize("cell", ["", "0.008", "25:00:00:00", "10:59:57", "no"])
def test_what_is_no_timecode_is_none(tmp_path: Path, cell: str) -> None:
    take = export(tmp_path, [SECONDS, "Timecode"], lambda k: [f"{k / HZ:.3f}", cell])
    assert take.timecode is None


def test_a_frame_may_lack_its_timecode(tmp_path: Path) -> None:
    take = export(tmp_path, [SECONDS, "Timecode"], lambda k: [f"{k / HZ:.3f}", timecode(k) if k % 2 else ""])
    assert take.timecode is not None
    assert take.timecode.texts[:2] == ("", timecode(1))
