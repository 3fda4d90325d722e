"""The measures on real takes, for which the scores of the captured fingers are known."""

import numpy as np
import pytest

from manipnet_tools.evaluation import metrics
from manipnet_tools.evaluation.cases import load_cases
from manipnet_tools.evaluation.judge import Judge
from manipnet_tools.evaluation.scoring import average
from manipnet_tools.takes.dataset import DataError


@pytest.fixture(scope="module")
def captured(cases):
    return {name: Judge(case, np.zeros((22, 3)), ("scores",))(case.captured) for name, case in cases.items()}


def test_captured_fingers_score_perfectly_on_comparisons_with_themselves(captured):
    for sides in captured.values():
        for one in sides.values():
            assert one.ratio == one.mpjpe_mm == one.tip_mm == one.drift_s == 0.0
            assert one.contact_f1 == one.contact_f1_many == one.finger_recall == 1.0
            assert one.smoothness_ratio == one.idle_ratio == one.idle_energy == 1.0
            assert one.touching_ratio == one.slide_ratio == one.opening_ratio == 1.0


def test_captured_fingers_explain_the_motion(captured):
    for sides in captured.values():
        assert average(sides.values()).physics > 0.97


def test_captured_penetration_of_the_mug(captured):
    assert captured["mug1"]["right"].penetration_cm == pytest.approx(0.08, abs=0.01)
    assert captured["mug1"]["left"].penetration_cm == pytest.approx(0.04, abs=0.01)


def test_captured_smoothness_of_the_cylinder(cases):
    smoothness = [metrics.smoothness_cm_s2(p) for p in cases["cyl_med3"].captured.values()]
    assert smoothness == pytest.approx([127, 117], rel=0.02)


def test_parts_keep_the_values_derived_from_the_whole_take(cases):
    case = cases["mug1"]
    part = case.part(0.8, 1.0)
    start = len(case) - len(part)
    assert part.ticks.time_s[0] == pytest.approx(0.8 * 3999 / 120, abs=1 / 60)
    assert part.ticks.time_s[-1] == case.ticks.time_s[-1]
    np.testing.assert_array_equal(part.lifted, case.lifted[start:])
    np.testing.assert_array_equal(part.gaps["left"].gap, case.gaps["left"].gap[start:])


def test_the_synthesis_receives_no_captured_fingers(cases):
    for seen in cases["mug1"].inputs.values():
        arrays = [value for value in vars(seen).values() if isinstance(value, np.ndarray)]
        assert [array.shape[1:] for array in arrays] == [(21, 7)] * 3 + [()]  # three bodies, which object


def test_a_folder_that_is_not_the_dataset_is_refused(tmp_path, manipnet_data):
    with pytest.raises(DataError, match="contains no takes; it must have folders BVH"):
        load_cases(tmp_path)
    with pytest.raises(DataError, match="has no take spoon9; it has"):
        load_cases(manipnet_data, ("spoon9",))
