"""BVH as programs write it: one take, written here with one thing changed at a time, reads as the plain one does."""

import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from manipnet.geometry import SIDES, Side, mirror_points
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet_tools import cli
from manipnet_tools.takes.bvh_motion import BvhError, read_bvh
from manipnet_tools.takes.take import Take, TakeError, read_take

FRAMES = 30
HAND = shipped_hand()
BOX_DM = np.array([0.5, 10.0, 1.0])
ROTATIONS = "Yrotation Xrotation Zrotation"
ROOT_CHANNELS = f"6 Xposition Yposition Zposition {ROTATIONS}"
Change = Callable[[str], str]


def joint(head: str, offset: np.ndarray, channels: str, inner: str = "") -> str:
    return f"{head}\n{{\nOFFSET {' '.join(f'{v:.6f}' for v in offset)}\nCHANNELS {channels}\n{inner}}}\n"


END = "End Site\n{\nOFFSET 0 0 0\n}\n"


def motion(rows: list[list[float]]) -> str:
    numbers = "\n".join(" ".join(f"{v:.6f}" for v in row) for row in rows)
    return f"MOTION\nFrames: {FRAMES}\nFrame Time: 0.008333334\n{numbers}\n"


def hand_text(side: Side, unit_m: float = 0.1, mirrored: bool = True) -> str:
    """A hand that bends its fingers; in left-handed decimetres unless told otherwise."""
    model = HAND.offsets if side == "right" else mirror_points(HAND.offsets)
    offsets = (mirror_points(model) if mirrored else model) / unit_m
    order: list[int] = []

    def build(j: int) -> str:
        order.append(j)
        children = [c for c in range(1, HAND.bone_count) if HAND.parents[c] == j]
        inner = "".join(map(build, children)) or END
        name = HAND.joint_names[j]
        head, channels = (f"JOINT {name}", f"3 {ROTATIONS}") if j else (f"ROOT {name}", ROOT_CHANNELS)
        return joint(head, offsets[j] if j else np.zeros(3), channels, inner)

    hierarchy = build(0)
    turn = -1.0 if mirrored else 1.0
    x_m = (0.2 if side == "right" else -0.2) * (-1.0 if mirrored else 1.0)
    rows = []
    for k in range(FRAMES):
        wrist = [x_m / unit_m, 1.0 / unit_m, 0.002 * k / unit_m, 0.0, 5.0, 0.0]
        rows.append(wrist + (len(order) - 1) * [turn * 3.0, 4.0, turn * 10.0])
    return "HIERARCHY\n" + hierarchy + motion(rows)


def box_text(offset: tuple[float, ...] = (0, 0, 0), name: str = "Box") -> str:
    rows = [[*BOX_DM, 0.1 * k, 0.0, 0.0] for k in range(FRAMES)]
    return "HIERARCHY\n" + joint(f"ROOT {name}", np.array(offset), ROOT_CHANNELS, END) + motion(rows)


def write_take(
    folder: Path,
    change: Change = str,
    box: str | None = None,
    box_file: str = "Box.bvh",
    change_box: Change | None = None,
) -> Path:
    folder.mkdir(exist_ok=True)
    for side in SIDES:
        (folder / f"{side}Hand.bvh").write_text(change(hand_text(side)), encoding="utf-8")
    (folder / box_file).write_text((change_box or change)(box or box_text()), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Take:
    return read_take(write_take(tmp_path_factory.mktemp("plain") / "plain"))


def check(take: Take, plain: Take, frames: int = FRAMES) -> None:
    assert (take.rate_hz, len(take.time_s)) == (plain.rate_hz, frames)
    assert take.bodies.keys() == plain.bodies.keys()
    for name, track in plain.bodies.items():
        np.testing.assert_allclose(take.bodies[name].poses, track.poses[:frames], atol=1e-6)
    for side, hand in plain.fingers.items():
        np.testing.assert_allclose(take.fingers[side].positions, hand.positions[:frames], atol=1e-6)
        np.testing.assert_allclose(take.fingers[side].rotations, hand.rotations[:frames], atol=1e-6)


def test_the_plain_take(plain: Take) -> None:
    assert plain.rate_hz == 120.0
    np.testing.assert_allclose(plain.bodies["Box"].poses[0], [-0.05, 1.0, 0.1, 0.0, 0.0, 0.0, 1.0], atol=1e-9)


@pytest.mark.parametrize("offset", [tuple(BOX_DM), (3.0, -2.0, 1.0)])
def test_position_channels_stand_in_place_of_the_offset(tmp_path: Path, plain: Take, offset: tuple[float, ...]) -> None:
    check(read_take(write_take(tmp_path / "plain", box=box_text(offset))), plain)


def test_an_offset_counts_along_the_axes_without_a_position_channel(tmp_path: Path) -> None:
    path = tmp_path / "a.bvh"
    inner = joint("JOINT b", np.array([1.0, 2.0, 3.0]), "2 Yposition Zrotation", END)
    path.write_text(
        "HIERARCHY\n"
        + joint("ROOT a", np.array([9.0, 9.0, 9.0]), "1 Xposition", inner)
        + "MOTION\nFrames: 1\nFrame Time: 0.01\n4 5 0\n"
    )
    translations, _ = read_bvh(path).local_transforms()
    np.testing.assert_array_equal(translations[0], [[4.0, 9.0, 9.0], [1.0, 5.0, 3.0]])


@pytest.mark.parametrize(
    "change",
    [
        lambda text: "\ufeff" + text,
        lambda text: text.replace("INDEX_MCP", "Bip01 INDEX_MCP"),
        lambda text: text.replace("INDEX_MCP", "Ann:INDEX_MCP"),
        lambda text: text.replace("\n", "\r\n"),
        lambda text: text.replace("\n", "\n\n"),
        lambda text: text.replace("\n{", " {").replace("OFFSET", "\tOFFSET"),
        lambda text: text.replace("Frame Time: 0.008333334", "Frame Time:0.00833333"),
        lambda text: text.replace("Frame Time: 0.008333334", "Frame Time: 8.333334e-3"),
        lambda text: text.replace("Frame Time: 0.008333334", "Frame Time: 0.008333"),
        lambda text: text.replace("Frame Time: 0.008333334", "Frame Time: 0.0083"),
        lambda text: (
            text.replace("Frames:", "FRAMES:").replace("position", "Position").replace("Hierarchy", "HIERARCHY")
        ),
        lambda text: text.replace(END, ""),
        lambda text: text.replace("End Site", "END SITE"),
        lambda text: text.rstrip("\n"),
    ],
    ids=[
        *("BOM", "spaces", "namespace", "CRLF", "blank_lines", "one_line_heads", "no_blank", "exponent"),
        *("six_digits", "four_digits", "case", "no_end_site", "END_SITE", "no_newline"),
    ],
)
def test_what_programs_write_reads_the_same(
    tmp_path: Path, plain: Take, change: Change, caplog: pytest.LogCaptureFixture
) -> None:
    check(read_take(write_take(tmp_path / "plain", change)), plain)
    assert not caplog.records


@pytest.mark.parametrize("announced", [FRAMES - 1, FRAMES + 1, 1, 0])
def test_another_number_of_frames_than_announced_is_read_with_a_note(
    tmp_path: Path, plain: Take, announced: int, caplog: pytest.LogCaptureFixture
) -> None:
    check(
        read_take(
            write_take(tmp_path / "plain", lambda text: text.replace(f"Frames: {FRAMES}", f"Frames: {announced}"))
        ),
        plain,
    )
    assert f"announces {announced} frames but has {FRAMES}, which are used" in caplog.text


def test_a_frame_more_in_one_file_is_left_out_with_a_note(
    tmp_path: Path, plain: Take, caplog: pytest.LogCaptureFixture
) -> None:
    take = write_take(tmp_path / "plain", change_box=lambda text: text.rstrip("\n").rpartition("\n")[0] + "\n")
    check(read_take(take), plain, FRAMES - 1)
    assert "only 29 frames are used, because leftHand, rightHand have more than the others" in caplog.text
    with pytest.raises(TakeError, match=r"must have the same number of frames, found Box 20, leftHand 30"):
        read_take(write_take(take, change_box=lambda text: "\n".join(text.rstrip("\n").split("\n")[:-10])))


def test_a_file_that_was_cut_off_loses_only_its_last_frame(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    take = read_take(write_take(tmp_path / "plain", change_box=lambda text: text[:-20]))
    assert len(take.time_s) == FRAMES - 1
    assert "ends in the middle of frame 29, which is left out" in caplog.text


@pytest.mark.parametrize("file", ["Box.BVH", "Box.Bvh"])
def test_capital_letters_in_a_file_name_make_no_difference(tmp_path: Path, plain: Take, file: str) -> None:
    check(read_take(write_take(tmp_path / "plain", box_file=file)), plain)
    (tmp_path / "plain" / "Box.bvh").write_text(box_text())
    with pytest.raises(TakeError, match=r"two files are called Box\.bvh if capital letters are ignored"):
        read_take(tmp_path / "plain")


def test_an_object_that_is_called_like_a_wrist_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TakeError, match="left_wrist is the name of a wrist; call the object"):
        read_take(write_take(tmp_path / "plain", box_file="left_wrist.bvh"))


def test_files_with_rounded_frame_times_share_one_rate(tmp_path: Path, plain: Take) -> None:
    rounded = write_take(tmp_path / "plain", change_box=lambda text: text.replace("0.008333334", "0.008333"))
    check(read_take(rounded), plain)
    other = write_take(tmp_path / "plain", change_box=lambda text: text.replace("0.008333334", "0.008342"))
    with pytest.raises(TakeError, match=r"must have one rate, found Box 119\.875 Hz, leftHand 120 Hz"):
        read_take(other)


@pytest.mark.parametrize(
    ("frame_time", "rate_hz"),
    [("0.0333333", 30), ("0.03333", 30), ("0.016667", 60), ("0.0166833", 59.94), ("0.01", 100), ("0.041667", 24)],
)
def test_a_rounded_frame_time_is_that_of_a_whole_rate(tmp_path: Path, frame_time: str, rate_hz: float) -> None:
    path = tmp_path / "Box.bvh"
    path.write_text(box_text().replace("0.008333334", frame_time))
    assert read_bvh(path).rate_hz == pytest.approx(rate_hz, abs=1e-3)


@pytest.mark.parametrize(("unit", "unit_m"), [("m", 1.0), ("cm", 0.01), ("mm", 0.001), ("in", 0.0254)])
@pytest.mark.parametrize("mirrored", [True, False])
def test_a_hand_shows_its_unit_and_handedness(
    tmp_path: Path, plain: Take, unit: str, unit_m: float, mirrored: bool, caplog: pytest.LogCaptureFixture
) -> None:
    folder = write_take(tmp_path / "plain", box=box_text())
    (folder / "Box.bvh").unlink()
    for side in SIDES:
        (folder / f"{side}Hand.bvh").write_text(hand_text(side, unit_m, mirrored))
    with caplog.at_level(logging.INFO):
        take = read_take(folder)
    for side in SIDES:
        np.testing.assert_allclose(take.fingers[side].positions, plain.fingers[side].positions, atol=2e-5)
    assert f"in {unit}, judging by the bones" in caplog.text


def test_lengths_that_do_not_fit_a_hand_in_any_unit_are_refused(tmp_path: Path) -> None:
    folder = write_take(tmp_path / "plain")
    for side in SIDES:
        (folder / f"{side}Hand.bvh").write_text(hand_text(side, 30.0))
    with pytest.raises(TakeError, match=r"bones have lengths that do not fit a hand in any unit \(m, dm, cm, mm, in\)"):
        read_take(folder)


@pytest.mark.parametrize("order", ["Zrotation Xrotation Yrotation", "Xrotation Yrotation Zrotation"])
def test_rotations_come_in_any_order(tmp_path: Path, order: str) -> None:
    path = tmp_path / "Box.bvh"
    path.write_text(box_text().replace(ROTATIONS, order))
    _, rotations = read_bvh(path).local_transforms()
    assert np.linalg.norm(rotations[10, 0, :3]) > 0.0
    assert np.argmax(np.abs(rotations[10, 0, :3])) == "XYZ".index(order[0])  # the first channel turns


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (
            lambda text: text.replace(".", ","),
            "the number '0,000000' has a decimal comma; export the file with decimal",
        ),
        (
            lambda text: "0.01".join(
                part.replace(".", ",") if n else part for n, part in enumerate(text.split("0.008333334"))
            ),
            "the numbers have decimal commas; export the file with decimal points",
        ),
        (
            lambda text: text.replace("MOTION", "ROOT Table\n{\nOFFSET 0 0 0\n}\nMOTION"),
            "has two roots, 'Box' and 'Table'",
        ),
        (lambda text: text.replace("MOTION", ""), "has no MOTION section"),
        (lambda text: text.replace("Xrotation", "Wrotation"), "'Wrotation' is unknown, allowed are Xposition"),
        (
            lambda text: text.replace(" 0.000000\n0.5", " 0.000000 1\n0.5"),
            r"frame 0 has 7 numbers; the channels of the hierarchy are 6",
        ),
        (lambda text: text.replace("Frame Time: 0.008333334", "Frame Time: 0"), "the frame time is 0"),
        (lambda text: text.replace("10.000000", "nan"), "frame 0 has a number that is not finite"),
        (lambda text: text.replace("1.000000", "1.0-7"), "must hold only numbers"),
        (lambda text: text.partition("0.008333334")[0] + "0.008\n", "holds no frame of 6 channels; 30 are announced"),
    ],
)
def test_a_bad_file_is_refused_for_the_true_reason(tmp_path: Path, change: Change, complaint: str) -> None:
    path = tmp_path / "Box.bvh"
    path.write_text(change(box_text()))
    with pytest.raises(BvhError, match=complaint):
        read_bvh(path)


def test_another_joint_is_named(tmp_path: Path) -> None:
    with pytest.raises(TakeError, match="'INDEX MIDDLE BONE' is not one of them"):
        read_take(write_take(tmp_path / "a", lambda text: text.replace("INDEX_MCP", "INDEX MIDDLE BONE")))


def test_a_take_for_other_programs_is_read_back(tmp_path: Path, plain: Take) -> None:
    source = write_take(tmp_path / "plain")
    assert cli.main(["export", str(source), "--format", "bvh", "--right-handed", "--out", str(tmp_path / "cm")]) == 0
    check(read_take(tmp_path / "cm"), plain)


def test_a_single_file_is_refused_with_the_way_round(tmp_path: Path) -> None:
    path = write_take(tmp_path / "plain") / "Box.bvh"
    with pytest.raises(TakeError, match="a single BVH file is not a take; give its folder"):
        read_take(path)
