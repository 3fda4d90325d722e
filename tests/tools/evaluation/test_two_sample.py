"""The classifier and the cloud distances on samples whose difference is known."""

import numpy as np
import pytest

from manipnet.synthesis.model.shipped import shipped_hand
from manipnet_tools.evaluation import metrics, two_sample, windows

HAND = shipped_hand()


def takes(rng, shift: float = 0.0, scale: float = 1.0) -> list[np.ndarray]:
    """Four takes, each with a character of its own that both kinds of hands share."""
    return [take + shift + scale * rng.normal(size=(200, 6)) for take in np.arange(4.0)]


def test_the_area_under_the_curve_counts_pairs():
    assert two_sample.auc(np.array([0.1, 0.4, 0.35, 0.8]), np.array([False, False, True, True])) == 0.75
    assert two_sample.auc(np.zeros(4), np.array([False, True, False, True])) == 0.5


@pytest.mark.parametrize(
    ("shift", "scale", "low", "high"),
    [
        (0.0, 1.0, 0.4, 0.6),  # the same distribution
        (1.0, 1.0, 0.9, 1.0),  # another mean
        (0.0, 0.3, 0.75, 1.0),  # too calm: seen by the squares
    ],
)
def test_a_classifier_finds_what_differs_and_nothing_else(shift, scale, low, high):
    rng = np.random.default_rng(1)
    standard = [rows - rows.mean(axis=0) for rows in takes(rng)]
    other = [rows - rows.mean(axis=0) + shift for rows in takes(rng, 0.0, scale)]
    assert low <= two_sample.left_out_auc(standard, other) <= high


def test_one_take_cannot_be_left_out():
    rows = np.zeros((10, 3))
    assert np.isnan(two_sample.left_out_auc([rows], [rows]))


def test_the_frechet_distance_of_gaussians():
    rng = np.random.default_rng(0)
    first = rng.normal(size=(20_000, 3))
    assert two_sample.frechet_distance(first, first) == pytest.approx(0.0, abs=1e-9)
    assert two_sample.frechet_distance(first, first + np.array([1.0, 0.0, 2.0])) == pytest.approx(5.0)
    assert two_sample.frechet_distance(first, 2.0 * first) == pytest.approx(3.0, rel=0.05)


def test_precision_falls_with_what_is_strange_and_recall_with_what_is_missing():
    rng = np.random.default_rng(0)
    truth = np.concatenate([rng.normal(size=(300, 2)), rng.normal(size=(300, 2)) + 20.0])
    half = rng.normal(size=(300, 2))
    strange = half + np.array([0.0, 50.0])
    assert two_sample.covered(half, truth) > 0.95
    assert 0.45 < two_sample.covered(truth, half) < 0.55
    assert two_sample.covered(strange, truth) == 0.0


def test_noise_bends_joints_by_three_degrees_and_keeps_the_bones():
    rng = np.random.default_rng(0)
    still = np.tile(np.linspace(0.0, 0.1, HAND.joint_count)[:, None] * [1.0, 0.3, 0.2], (1200, 1, 1))
    noisy = windows.shaken(HAND, still, rng)
    for finger in HAND.fingers:
        np.testing.assert_allclose(noisy[:, finger[0]], still[:, finger[0]])
        bones, before = (np.diff(p[:, finger], axis=1) for p in (noisy, still))
        np.testing.assert_allclose(np.linalg.norm(bones, axis=2), np.linalg.norm(before, axis=2), atol=1e-12)
        flat = np.arctan2(bones[:, 0, 2], bones[:, 0, 0])
        assert np.degrees(flat.std()) == pytest.approx(3.0, rel=0.02)
        assert np.diff(np.degrees(flat)).std() < 0.7  # slow


def test_windows_do_not_see_where_the_fingers_are(cases):
    case = cases["mug1"].part(0.4, 0.6)
    hand = case.captured["right"]
    rows = windows.window_rows(case, "right", hand)
    frames = len(case) - metrics.SETTLE_FRAMES
    assert len(rows) == (frames - windows.WINDOW_FRAMES) // windows.STEP_FRAMES + 1
    joints = HAND.joint_count - 1
    moved = windows.window_rows(case, "right", hand + np.array([0.0, 0.3, 0.0]))
    np.testing.assert_allclose(moved[:, : 4 * joints], rows[:, : 4 * joints], atol=1e-9)
    assert not np.allclose(moved[:, 4 * joints :], rows[:, 4 * joints :])  # the gaps differ


def test_a_take_that_is_too_short_has_no_window(cases):
    part = cases["mug1"].part(0.4, 0.44)
    longer = windows.window_rows(cases["mug1"].part(0.4, 0.5), "left", cases["mug1"].part(0.4, 0.5).captured["left"])
    assert windows.window_rows(part, "left", part.captured["left"]).shape == (0, longer.shape[1])


def test_noise_on_captured_motion_is_found_and_its_halves_are_alike(cases):
    rng = np.random.default_rng(0)
    parts = [case.part(start, start + 0.3) for case in cases.values() for start in (0.1, 0.4, 0.7)]
    captured = [windows.window_rows(part, "right", part.captured["right"]) for part in parts]
    noisy = [windows.window_rows(part, "right", windows.shaken(HAND, part.captured["right"], rng)) for part in parts]
    halves = [np.array_split(rows, 2) for rows in captured]
    assert two_sample.left_out_auc(captured, noisy) > 0.8
    assert two_sample.left_out_auc([a for a, _ in halves], [b for _, b in halves]) < 0.7
