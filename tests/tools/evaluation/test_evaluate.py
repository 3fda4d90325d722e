"""The evaluation as a whole, on stretches of real takes and a model that never moves."""

import json
from dataclasses import replace
from io import StringIO

import numpy as np
import pytest
from rich.console import Console
from rich.progress import Progress

from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.model.bundle import load_bundle
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet_tools.evaluation import report
from manipnet_tools.evaluation.results import CAPTURED, HOLD, MEAN, NEAREST, Fold
from manipnet_tools.evaluation.roll_outs import baseline_rows, evaluate, folds, model_rows
from manipnet_tools.evaluation.sweeps import noise, scale

HAND = shipped_hand()


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

    take, case = read_take(manipnet_data / "BVH" / "mug1"), cases["mug1"]
    shaken = noise(0.001, 0.0)(take, case)
    moved = shaken.inputs["left"].wrist[..., :3] - case.inputs["left"].wrist[..., :3]
    assert np.std(moved) == pytest.approx(0.001, rel=0.02)
    assert shaken.captured is case.captured
    larger = scale(1.4)(take, case)
    assert larger.inputs["right"].scale == 1.4
    np.testing.assert_allclose(larger.shape.bounds, 1.4 * case.shape.bounds, atol=1e-9)
