"""The evaluation as a whole, on stretches of real takes and a model that never moves."""

import json
import re
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from rich.progress import Progress

from manipnet import geometry
from manipnet.geometry import Array, Side
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.model.bundle import load_bundle
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet_tools.evaluation import report
from manipnet_tools.evaluation.finger_files import finger_files, read_fingers
from manipnet_tools.evaluation.pictures import PICTURE, grasp_picture
from manipnet_tools.evaluation.realism import CEILING, FLOOR, realism
from manipnet_tools.evaluation.results import CAPTURED, HOLD, MEAN, NEAREST, Fold
from manipnet_tools.evaluation.roll_outs import baseline_rows, evaluate, folds, model_rows
from manipnet_tools.evaluation.sheet import write_sheet
from manipnet_tools.evaluation.sweeps import noise, scale, tracked
from manipnet_tools.takes.dataset import DataError

HAND = shipped_hand()
SIZE = PICTURE[0]


@pytest.fixture(scope="module")
def results(cases, still_model):
    fold = Fold("seen", [cases["cyl_med3"].part(0.2, 0.5)], [cases["mug1"].part(0.4, 0.5)])
    bundle = load_bundle(still_model)
    sources = baseline_rows(lambda fold: bundle) | model_rows({"still": lambda fold: bundle}, ["none"])
    return evaluate([fold], "seen", sources, Progress(disable=True))


def test_every_row_covers_every_case(results):
    assert list(results.rows) == [CAPTURED, MEAN, NEAREST, HOLD, "still, no IK"]
    for row in results.rows.values():
        assert set(row.scores["mug1"]) == {"left", "right"}


def test_rows_hold_what_their_names_say(results):
    assert results.rows[MEAN].average.ratio == pytest.approx(1.0)
    assert results.rows[HOLD].average.smoothness == 0.0
    np.testing.assert_array_equal(
        results.rows[HOLD].hands["mug1"]["left"][0], forward_kinematics(HAND, np.zeros(20))[0]
    )
    still = results.rows["still, no IK"]
    assert still.average.smoothness == pytest.approx(0.0, abs=1e-3)
    assert still.average.mpjpe_mm > results.rows[CAPTURED].average.mpjpe_mm == 0.0


def test_a_model_that_never_moves_misses_its_targets(results):
    by_measure = {verdict["measure"]: verdict for verdict in report.verdicts(results, "still, no IK")}
    assert not by_measure["smoothness_ratio"]["met"]
    assert not by_measure["ratio"]["met"]
    assert by_measure["idle_ratio"]["target"] == "≤ 1"


def test_the_report_is_json_and_tables(results):
    content = json.loads(json.dumps(report.as_json(results, "still, no IK", {}), allow_nan=False))
    assert content["rows"][CAPTURED]["takes"]["mug1"]["left"]["contact_f1"] == 1.0
    console = Console(width=100, record=True, file=StringIO())
    for table in report.tables(results, "still, no IK", {}):
        console.print(table)
    text = console.export_text()
    assert "error ratio, near" in text
    assert "missed" in text


def test_folds_keep_test_frames_out_of_training(cases):
    everything = list(cases.values())
    (seen,) = folds(everything, "seen", cases)
    for train, test in zip(seen.train, seen.test, strict=True):
        assert train.ticks.time_s[-1] < test.ticks.time_s[0]
    unseen = folds(everything, "unseen", ["mug1"])
    assert [(fold.name, [case.name for case in fold.train]) for fold in unseen] == [("mug1", ["cyl_med3"])]


def test_the_key_of_a_sheet_says_which_picture_is_captured(results, tmp_path):
    pytest.importorskip("embreex")
    pillow = pytest.importorskip("PIL.Image")
    ours, path = "still, no IK", tmp_path / "sheet.png"
    answers = write_sheet(results, ours, path, np.random.default_rng(1)).read_text().splitlines()
    assert answers[0] == f"captured fingers in each pair; the other picture is {ours}"
    pairs = [re.fullmatch(r"pair (\d+): (left|right)   mug1, (left|right) hand, tick (\d+)", a) for a in answers[1:]]
    assert len(pairs) > 1
    assert {pair[2] for pair in pairs if pair} == {"left", "right"}
    sheet, case = np.asarray(pillow.open(path)), results.cases["mug1"]
    for k, pair in enumerate(pairs):
        assert pair is not None
        left = SIZE * (2 * k % 4 + (pair[2] == "right"))
        top = SIZE * (2 * k // 4)
        side: Side = "left" if pair[3] == "left" else "right"
        tick = int(pair[4])
        expected = grasp_picture(case, side, case.captured[side][tick], tick, mark=False)
        np.testing.assert_array_equal(sheet[top : top + SIZE, left : left + SIZE], expected)


def test_a_file_of_synthesize_is_a_row_like_any_other(results, tmp_path):
    case = results.cases["mug1"]
    world = {
        f"{side}_positions": geometry.transform(
            case.ticks.bodies[f"{side}_wrist"].poses[:, None],
            geometry.mirror_points(positions) if side == "left" else positions,
        )
        for side, positions in case.captured.items()
    }
    path = tmp_path / "fingers.npz"

    def write(time_s: Array, arrays: dict[str, Array]) -> None:
        np.savez(path, allow_pickle=False, time=time_s, **arrays)

    write(case.ticks.time_s, world)
    for side, positions in read_fingers(path, case).items():
        np.testing.assert_allclose(positions, case.captured[side], atol=1e-12)
    later = case[: len(case) // 2]
    assert len(read_fingers(path, later)["left"]) == len(later)
    write(case.ticks.time_s[:-5], {name: p[:-5] for name, p in world.items()})
    with pytest.raises(DataError, match=r"fingers.npz: holds .* s; mug1 is judged from"):
        read_fingers(path, case)
    write(case.ticks.time_s, {})
    with pytest.raises(DataError, match="is not a file of manipnet synthesize"):
        read_fingers(path, case)


def test_files_are_named_by_take():
    assert finger_files(["mug1=a.npz"], ["mug1"]) == {"mug1": Path("a.npz")}
    with pytest.raises(DataError, match=r"must be TAKE=FILE\.npz"):
        finger_files(["a.npz"], ["mug1"])
    with pytest.raises(DataError, match="has no take 'spoon'; it has mug1"):
        finger_files(["spoon=a.npz"], ["mug1"])


def test_short_takes_have_no_realism(cases, still_model):
    bundle = load_bundle(still_model)
    fold = Fold("seen", [cases["mug1"].part(0.0, 0.2)], [cases["mug1"].part(0.4, 0.44)])
    rows = evaluate([fold], "seen", model_rows({"still": lambda fold: bundle}, ["none"]), Progress(disable=True), ())
    assert realism(rows) == {}


def test_a_hand_that_never_moves_is_told_from_captured_hands(cases, still_model):
    bundle = load_bundle(still_model)
    parts = [case.part(0.3, 0.6) for case in cases.values()]
    fold = Fold("seen", [case.part(0.0, 0.2) for case in cases.values()], parts)
    rows = evaluate([fold], "seen", model_rows({"still": lambda fold: bundle}, ["none"]), Progress(disable=True), ())
    found = realism(rows)
    assert list(found) == [FLOOR, MEAN, "still, no IK", CEILING]
    assert found["still, no IK"].auc > 0.95 > 0.7 > found[FLOOR].auc
    assert found["still, no IK"].frechet > found[FLOOR].frechet
    assert found["still, no IK"].recall < 0.2
    tables = list(report.tables(rows, "still, no IK", found))
    assert [table.title for table in tables] == ["seen: told from captured hands"]


def test_a_sweep_is_plotted(results, tmp_path):
    pytest.importorskip("matplotlib")
    from manipnet_tools.evaluation import plots

    away = replace(results.rows[MEAN].average, near_mm=float("nan"), contact_f1=float("nan"))
    rows = {"0.5 s": results.rows[HOLD].average, "0 s": away}
    path = plots.write_sweep("look-ahead", rows, tmp_path / "plots")
    assert path.name == "sweep-look-ahead.png"
    assert path.read_bytes().startswith(b"\x89PNG")


def test_a_sweep_changes_the_input_and_not_the_truth(cases, manipnet_data):
    from manipnet_tools.takes.take import read_take
    from manipnet_tools.takes.tracker import Tracker

    take, case = read_take(manipnet_data / "BVH" / "mug1"), cases["mug1"]
    shaken = noise(0.0001, 0.0)(take, case)
    moved = shaken.inputs["left"].wrist[..., :3] - case.inputs["left"].wrist[..., :3]
    assert np.std(moved) == pytest.approx(0.0001, rel=0.02)
    np.testing.assert_array_equal(shaken.captured["left"], case.captured["left"])
    other = tracked(Tracker(rate_hz=90.0), 0.1)(take, case)
    assert len(case) - 2 <= len(other) <= len(case)
    assert len(other.inputs["left"]) == len(other.captured["left"]) == len(other)
    larger = scale(1.4)(take, case)
    assert larger.inputs["right"].scale == 1.4
    np.testing.assert_allclose(larger.shape.bounds, 1.4 * case.shape.bounds, atol=1e-9)
