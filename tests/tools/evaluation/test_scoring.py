"""Averages of scores, and targets."""

from dataclasses import fields

import numpy as np
import pytest

from manipnet_tools.evaluation.scoring import TARGETS, Score, Target, average


def score(**measures: float) -> Score:
    return Score(**{field.name: 0.5 for field in fields(Score)} | measures)


def test_the_average_leaves_out_measures_that_a_case_lacks():
    mean = average([score(ratio=0.4, drift_s=1.0), score(ratio=0.6, drift_s=3.0), score(ratio=np.nan)])
    assert mean.ratio == pytest.approx(0.5)
    assert mean.drift_s == 3.0
    assert np.isnan(average([score(ratio=np.nan)]).ratio)


def test_targets_against_the_captured_fingers():
    target = Target("penetration_cm", "", -np.inf, 0.03, "difference")
    assert target.met(score(penetration_cm=0.10), score(penetration_cm=0.08))
    assert not target.met(score(penetration_cm=0.12), score(penetration_cm=0.08))
    share = Target("drop_left", "", 0.95, np.inf, "ratio")
    assert share.met(score(drop_left=0.76), score(drop_left=0.8))
    assert not share.met(score(drop_left=0.75), score(drop_left=0.8))
    assert not Target("contact_f1", "", 0.92, 1.0).met(score(contact_f1=np.nan), score())


@pytest.mark.parametrize("protocol", ["seen", "unseen"])
def test_the_captured_fingers_meet_their_own_targets(protocol):
    captured = score(
        ratio=0.0, contact_f1=1.0, smoothness_ratio=1.0, idle_ratio=1.0, touching_ratio=1.0, slide_ratio=1.0
    )
    assert all(target.met(captured, captured) for target in TARGETS[protocol])
