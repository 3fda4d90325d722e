"""Motive's CSV as its versions export it and as other programs save it again; every file is written here."""

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from manipnet_tools import cli
from manipnet_tools.commands.replay import take_frames
from manipnet_tools.takes.take import Take, TakeError, read_take

NAMES = ("left_wrist", "right_wrist", "Box")
FRAMES = 132
AXES = {"Rotation": "XYZW", "Position": "XYZ"}


@dataclass(frozen=True)
class Export:
    """The settings of an export, and the program that saved it last."""

    names: tuple[str, ...] = NAMES
    kinds: tuple[str, ...] = ("Rigid Body",) * 3
    version: str = "1.23"
    labels: bool = True
    ids: tuple[str, ...] | None = ("A0", "A1", "A2")
    parents: bool = False
    time_code: bool = False
    parts: tuple[tuple[str, ...], ...] = (("Rotation", "Position"),) * 3
    separator: str = ","
    decimal: str = "."
    surplus: str = ""
    """What stands behind each line."""
    per_frame: int = 1
    rate_hz: float = 120.0
    capture_hz: float = 120.0

    def text(self) -> str:
        before = ["", ""] + [""] * self.time_code
        columns = [(i, part, axis) for i in range(len(self.names)) for part in self.parts[i] for axis in AXES[part]]

        def head(word: str, cells: list[str]) -> list[str]:
            return ["", word if self.labels else "", *before[2:], *cells]

        rows = [
            head("Type", [self.kinds[i] for i, _, _ in columns]),
            head("Name", [self.names[i] for i, _, _ in columns]),
        ]
        if self.ids is not None:
            rows.append(head("ID", [f'"{self.ids[i]}"' for i, _, _ in columns]))
        if self.parents:
            rows.append(head("Parent", ["" for _ in columns]))
        rows.append([*before, *(part for _, part, _ in columns)])
        time = ["Frame", "Time (Seconds)" if self.labels else "Time", *["TimeCode"] * self.time_code]
        rows.append([*time, *(axis for _, _, axis in columns)])
        for k in range(FRAMES):
            values = [pose(i, k)[part][AXES[part].index(axis)] for i, part, axis in columns]
            code = [f"15:26:46:{k:02d}.00"] * self.time_code
            cells = [f"{v:.6f}".replace(".", self.decimal) for v in (k / self.rate_hz, *values)]
            rows.append([str(k * self.per_frame), cells[0], *code, *cells[1:]])
        keys = {
            "Format Version": self.version,
            "Take Name": "Take 1",
            "Take Notes": "",
            "Capture Frame Rate": f"{self.capture_hz:.6f}".replace(".", self.decimal),
            "Export Frame Rate": f"{self.rate_hz:.6f}".replace(".", self.decimal),
            "Total Exported Frames": str(FRAMES),
            "Rotation Type": "Quaternion",
            "Length Units": "Meters",
            "Coordinate Space": "Global",
        }
        first = [cell for pair in keys.items() for cell in pair]
        return "\n".join(self.separator.join(row) + self.surplus for row in [first, [], *rows]) + "\n"


def pose(body: int, frame: int) -> dict[str, tuple[float, ...]]:
    """A turn about another axis for each body, and a place of its own."""
    half = 0.02 * frame / (body + 1)
    rotation = [0.0, 0.0, 0.0, float(np.cos(half))]
    rotation[body] = float(np.sin(half))
    return {"Rotation": tuple(rotation), "Position": (0.1 * body, 1.0, 0.001 * frame)}


def poses(body: int) -> np.ndarray:
    return np.array([(*pose(body, k)["Position"], *pose(body, k)["Rotation"]) for k in range(FRAMES)])


def read(folder: Path, export: Export, encoding: str = "utf-8", name: str = "take.csv") -> Take:
    return written(folder, export.text(), encoding, name)


def written(folder: Path, text: str, encoding: str = "utf-8", name: str = "take.csv") -> Take:
    path = folder / name
    path.write_bytes(text.encode(encoding))
    return read_take(path)


def check(take: Take, names: tuple[str, ...] = NAMES, places: int = 6) -> None:
    assert set(take.bodies) == set(names)
    assert (take.rate_hz, len(take.time_s)) == (120.0, FRAMES)
    assert np.allclose(take.time_s, np.arange(FRAMES) / 120)
    for body, name in enumerate(names):
        track = take.bodies[name]
        assert track.tracked.all()
        np.testing.assert_allclose(track.poses, poses(body), atol=2 * 10.0**-places)


@pytest.mark.parametrize(
    "export",
    [
        Export(version="1.2", labels=False),
        Export(version="1.21", labels=False),
        Export(version="1.22", labels=False, ids=None),
        Export(version="1.22", ids=None),
        Export(version="1.23"),
        Export(version="1.24", time_code=True),
        Export(version="1.25", parents=True),
        Export(parts=(("Position", "Rotation"),) * 3),
        Export(separator=";", decimal=","),
        Export(separator=";"),
        Export(separator="\t", decimal=","),
        Export(surplus=",,,,"),
        Export(per_frame=2, capture_hz=240.0),  # frames are counted at the rate of the capture
    ],
    ids=lambda export: str([f"{k}={v}" for k, v in vars(export).items() if v != getattr(Export(), k)]),
)
def test_every_version_reads_the_same(tmp_path: Path, export: Export) -> None:
    check(read(tmp_path, export))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1252"])
def test_every_encoding_reads_the_same(tmp_path: Path, encoding: str) -> None:
    names = ("left_wrist", "right_wrist", "Würfel")
    check(read(tmp_path, Export(names=names), encoding), names)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_every_line_end_reads_the_same(tmp_path: Path, end: str) -> None:
    check(written(tmp_path, Export().text().replace("\n", end), name="TAKE.CSV"))


def test_notes_with_commas_do_not_shift_the_settings(tmp_path: Path) -> None:
    check(written(tmp_path, Export().text().replace("Take Notes,,", "Take Notes,first try, left hand slips,again,")))


def test_bones_are_wrists_and_props(tmp_path: Path) -> None:
    names = ("Ann:LHand", "Ann:RHand", "Ann:Head")
    take = read(tmp_path, Export(names=names, kinds=("Bone",) * 3, parents=True))
    check(take, ("left_wrist", "right_wrist", "Ann:Head"))
    mixed = read(tmp_path, Export(names=("LeftHand", "Ann:LHand", "Box"), kinds=("Rigid Body", "Bone", "Rigid Body")))
    check(mixed, ("left_wrist", "Ann:LHand", "Box"))


def test_the_hands_of_two_skeletons_keep_their_names(tmp_path: Path) -> None:
    names = ("Ann:LHand", "Bob:LHand", "Box")
    check(read(tmp_path, Export(names=names, kinds=("Bone", "Bone", "Rigid Body"))), names)


def test_markers_are_skipped_and_bodies_without_rotation_are_reported(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    export = Export(kinds=("Rigid Body", "Rigid Body", "Rigid Body Marker"))
    assert set(read(tmp_path, export).bodies) == {"left_wrist", "right_wrist"}
    assert not caplog.records
    partial = Export(parts=(("Rotation", "Position"), ("Rotation", "Position"), ("Position",)))
    assert set(read(tmp_path, partial).bodies) == {"left_wrist", "right_wrist"}
    assert "these bodies are left out because they lack rotation or position: Box" in caplog.text


@pytest.mark.parametrize("other", ["Left Hand", "LeftWrist", "l_hand"])
def test_two_bodies_that_could_be_one_wrist_are_refused_with_both_names(tmp_path: Path, other: str) -> None:
    with pytest.raises(TakeError, match=rf"take\.csv: 'LeftHand' and '{other}' could each be left_wrist"):
        read(tmp_path, Export(names=("LeftHand", "RightHand", other)))


def test_the_exact_name_is_the_wrist_and_the_other_a_prop(tmp_path: Path) -> None:
    names = ("left_wrist", "right_wrist", "Left Hand")
    check(read(tmp_path, Export(names=names)), names)


def test_the_names_of_a_rig_stay_as_they_are(tmp_path: Path) -> None:
    path = tmp_path / "take.csv"
    path.write_text(Export(names=("LeftHand", "RightHand", "Left Hand")).text())
    take = read_take(path, keep={"LeftHand", "RightHand", "Left Hand"})
    check(take, ("LeftHand", "RightHand", "Left Hand"))


def test_two_bodies_of_one_name_are_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(TakeError, match=r"two bodies are called 'Box' \(IDs A1 and A2\)"):
        read(tmp_path, Export(names=("left_wrist", "Box", "Box")))
    with pytest.raises(TakeError, match=r"two bodies are called 'Box'; rename one"):
        read(tmp_path, Export(names=("left_wrist", "Box", "Box"), ids=None))


def test_z_up_is_turned_to_y_up_as_a_stream_is(tmp_path: Path) -> None:
    path = tmp_path / "take.csv"
    path.write_text(Export().text())
    track = read_take(path, up="z").bodies["right_wrist"]
    x, y, z, qx, qy, qz, qw = poses(1).T
    np.testing.assert_allclose(track.poses, np.stack([x, z, -y, qx, qz, -qy, qw], axis=1), atol=2e-6)
    (tmp_path / "motion.txt").write_text("120\n")
    with pytest.raises(TakeError, match=r"--up z is for \.csv and \.mcap files"):
        read_take(tmp_path / "motion.txt", up="z")


@pytest.mark.parametrize("verb", ["replay", "synthesize", "batch"])
def test_the_up_axis_is_an_option(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        cli.main([verb, "--help"])
    assert "--up {y,z}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("0.008333,", "0,008333,", "its numbers have decimal commas, which look like the commas between cells"),
        ("Format Version", "", "whose first line starts with Format Version; turn on Header Information"),
        ("Frame,Time", "Sample,Time", "has no line that begins with Frame"),
    ],
)
def test_the_reason_of_a_refusal_is_the_true_one(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    text = Export(decimal=",").text() if "commas" in complaint else Export().text().replace(old, new)
    with pytest.raises(TakeError, match=complaint):
        written(tmp_path, text)


def frame_list(end: str = "") -> str:
    """The list of frames that Tracking Tools and the first versions of Motive export."""
    lines = [
        "comment,OptiTrack",
        "righthanded",
        "info,version,1.1",
        f"info,framecount,{FRAMES}",
        "info,rigidbodycount,3",
    ]
    lines += [f"rigidbody,{name},{7 - i},1,0.0,0.0,0.0" for i, name in enumerate(NAMES)]
    for k in range(FRAMES):
        seen = [i for i in range(3) if (i, k) != (2, 5)]
        cells = [f"{7 - i},{_numbers(pose(i, k)['Position'])},{_numbers(pose(i, k)['Rotation'])},0,0,0" for i in seen]
        if k == 6:
            cells[0] = "7,1.#QNAN,1.0,0.0,0,0,0,1,0,0,0"
        lines += [f"frame,{k},{k / 120:.6f},{len(seen)},{','.join(cells)},0", f"rigidbody,{k},{k / 120:.6f},Box,5,0,0"]
    return "\n".join(lines) + end


def _numbers(values: tuple[float, ...]) -> str:
    return ",".join(f"{value:.6f}" for value in values)


def test_the_list_of_frames_of_the_first_versions_reads_the_same(tmp_path: Path) -> None:
    take = written(tmp_path, frame_list("\n"))
    assert (take.rate_hz, list(take.bodies)) == (120.0, list(NAMES))
    assert np.flatnonzero(~take.bodies["Box"].tracked).tolist() == [5]
    assert np.flatnonzero(~take.bodies["left_wrist"].tracked).tolist() == [6]
    np.testing.assert_allclose(take.bodies["right_wrist"].poses, poses(1), atol=2e-6)
    with pytest.raises(TakeError, match="is left-handed; export it right-handed"):
        written(tmp_path, frame_list().replace("righthanded", "lefthanded"))
    with pytest.raises(TakeError, match="line 9: is not a frame"):
        written(tmp_path, frame_list().replace("frame,0,0.000000,3,", "frame,0,0.000000,30,"))


@pytest.mark.parametrize("factor", [1e6, 1e5])
def test_numbers_without_their_decimal_points_are_refused(tmp_path: Path, factor: float) -> None:
    lines = Export().text().splitlines()
    spoilt = [
        ",".join([*line.split(",")[:2], *(f"{float(c) * factor:.0f}" for c in line.split(",")[2:])])
        for line in lines[7:]
    ]
    with pytest.raises(TakeError, match="another program has saved the file without its decimal points"):
        written(tmp_path, "\n".join([*lines[:7], *spoilt]) + "\n")


def test_ragged_lines_are_lost_bodies_and_surplus_cells_are_passed_over(tmp_path: Path) -> None:
    lines = Export().text().splitlines()
    lines[10] = ",".join(lines[10].split(",")[:-7])  # a program that drops empty cells at the end of a line
    lines[11] += ",,"
    take = written(tmp_path, "\n".join(lines) + "\n")
    assert np.flatnonzero(~take.bodies["Box"].tracked).tolist() == [3]
    assert take.bodies["left_wrist"].tracked.all()


def test_a_file_that_was_cut_off_loses_only_its_last_line(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    take = written(tmp_path, Export().text()[:-40])
    assert len(take.time_s) == FRAMES - 1
    assert "ends in the middle of line 139, which is left out" in caplog.text
    assert "announces 132 frames but has 131" in caplog.text


def test_replay_sends_the_take_of_an_old_motive(tmp_path: Path) -> None:
    frames = list(take_frames(read(tmp_path, Export(version="1.21", labels=False))))
    assert len(frames) == FRAMES
    assert [body.name for body in frames[0].bodies] == list(NAMES)


def test_reading_says_nothing_about_a_good_file(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        read(tmp_path, Export())
    assert not caplog.records
