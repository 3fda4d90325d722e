"""Motive's CSV in the variants that versions and export settings of Motive make."""

from pathlib import Path

import numpy as np
import pytest

from manipnet_tools.takes.take import Take, read_take

NAMES = ("LeftWrist", "RightWrist", "Box")
SEEN = "0,0,0,1,0.1,1.2,-0.3"


def export(
    tmp_path: Path,
    first: str = "Format Version,1.23,Capture Frame Rate,120.000000,Export Frame Rate,120.000000,"
    "Rotation Type,Quaternion,Length Units,Meters,Coordinate Space,Global",
    parts: tuple[str, ...] = ("Rotation", "Position"),
    parent_row: bool = False,
    error_column: bool = True,
    rows: tuple[str, ...] = (SEEN, SEEN),
    end: str = "\n",
    mark: str = "",
) -> Take:
    """One frame per row, the same for every body."""
    columns = {"Rotation": list("XYZW"), "Position": list("XYZ")}
    shown = [(part, axis) for part in parts for axis in columns[part]] + [("Mean Marker Error", "")] * error_column
    names = [name for name in NAMES for _ in shown]
    head = [
        ["", "Type"] + ["Rigid Body"] * len(names) + ["Rigid Body Marker"] * 3,
        ["", "Name"] + names + ["Box:Marker 001"] * 3,
        ["", "ID"] + ["1B2D3F"] * len(names) + ["77"] * 3,
        *([["", "Parent"] + [""] * len(names) + ["Box"] * 3] if parent_row else []),
        ["", ""] + [part for part, _ in shown] * len(NAMES) + ["Position"] * 3,
        ["Frame", "Time (Seconds)"] + [axis for _, axis in shown] * len(NAMES) + list("XYZ"),
    ]
    cells = [",".join([row + ",0.001" * error_column * bool(row.strip(","))] * len(NAMES)) for row in rows]
    body = [f"{240 + k},{k / 120:.3f},{line},1,2,3" for k, line in enumerate(cells)]
    path = tmp_path / "take.csv"
    path.write_bytes((mark + end.join([first, "", *(",".join(line) for line in head), *body]) + end).encode())
    return read_take(path)


def check(take: Take) -> None:
    assert list(take.bodies) == ["left_wrist", "right_wrist", "Box"]
    assert take.rate_hz == 120.0
    for track in take.bodies.values():
        assert np.allclose(track.poses, [0.1, 1.2, -0.3, 0.0, 0.0, 0.0, 1.0])
        assert track.tracked.all()


@pytest.mark.parametrize(
    "variant",
    [
        {},
        {"parent_row": True},  # Motive 3 with skeletons in the take
        {"error_column": False},
        {"end": "\r\n"},
        {"mark": "\ufeff"},  # saved by a spreadsheet
        {"parts": ("Position", "Rotation"), "rows": ("0.1,1.2,-0.3,0,0,0,1",) * 2},
        {"rows": ("0,0,0,-1,0.1,1.2,-0.3", "0,0,0,2,0.1,1.2,-0.3"), "error_column": True},
    ],
)
def test_every_variant_reads_the_same(tmp_path: Path, variant: dict) -> None:
    take = export(tmp_path, **variant)
    for track in take.bodies.values():
        track.poses[:, 3:] *= np.sign(track.poses[:, 6:])
    check(take)


@pytest.mark.parametrize(
    ("unit", "row"), [("Meters", SEEN), ("Centimeters", "0,0,0,1,10,120,-30"), ("Millimeters", "0,0,0,1,100,1200,-300")]
)
def test_lengths_come_in_three_units(tmp_path: Path, unit: str, row: str) -> None:
    first = f"Format Version,1.21,Capture Frame Rate,120,Export Frame Rate,120,Length Units,{unit}"
    check(export(tmp_path, first, rows=(row, row)))


def test_times_are_frames_over_rate_not_the_rounded_column(tmp_path: Path) -> None:
    take = export(tmp_path, rows=(SEEN,) * 50)
    assert np.allclose(take.time_s, np.arange(50) / 120, atol=1e-12)


def test_an_export_at_another_rate_counts_by_the_export(tmp_path: Path) -> None:
    first = "Format Version,1.23,Capture Frame Rate,240,Export Frame Rate,120,Length Units,Meters"
    assert export(tmp_path, first).rate_hz == 120.0


def test_empty_cells_are_a_lost_body(tmp_path: Path) -> None:
    take = export(tmp_path, rows=(SEEN, ",,,,,,", SEEN))
    for track in take.bodies.values():
        assert track.tracked.tolist() == [True, False, True]
        assert np.isfinite(track.poses).all()
