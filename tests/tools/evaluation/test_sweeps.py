"""Sweeps: how they change the input."""

import numpy as np

from manipnet_tools.evaluation.sweeps import forwards_and_backwards
from manipnet_tools.takes.rollout import HandInput


def test_the_windows_of_an_input_played_backwards_are_reversed():
    windows = np.arange(3 * 21 * 7, dtype=np.float64).reshape(3, 21, 7)
    seen = HandInput("right", windows, windows + 1.0, windows + 2.0, (), np.array([4, 5, 6]))
    played = forwards_and_backwards(seen, np.array([0, 1, 2, 2, 1]), np.array([True, True, True, False, False]))
    assert len(played) == 5
    np.testing.assert_array_equal(played.held, [4, 5, 6, 6, 5])
    np.testing.assert_array_equal(played.wrist[1], windows[1])
    np.testing.assert_array_equal(played.wrist[4], windows[1, ::-1])
    np.testing.assert_array_equal(played.object[3], windows[2, ::-1] + 2.0)
