"""The histogram of durations: its percentiles are those of the durations themselves, in little memory."""

import numpy as np
import pytest

from manipnet.common.durations import LONGEST_S, SHORTEST_S, Durations


def test_percentiles_are_right_to_a_thousandth() -> None:
    seconds = np.random.default_rng(1).lognormal(-6.0, 1.0, 5000)
    durations = Durations()
    for each in seconds:
        durations.add(float(each))
    for percent in (0.0, 1.0, 50.0, 99.0, 99.9, 100.0):
        exact = np.percentile(seconds, percent, method="inverted_cdf")
        assert durations.percentile(percent) == pytest.approx(exact, rel=1.001e-3), percent
    assert durations.count == len(seconds)
    assert durations.sum_s == pytest.approx(seconds.sum())


def test_durations_beyond_the_ends_count_as_the_ends() -> None:
    durations = Durations()
    durations.add(-1.0)
    durations.add(1e9)
    assert durations.percentile(0.0) == pytest.approx(SHORTEST_S)
    assert durations.percentile(100.0) == pytest.approx(LONGEST_S, rel=1.001e-3)


def test_there_is_nothing_before_the_first() -> None:
    assert Durations().percentile(50.0) == 0.0
