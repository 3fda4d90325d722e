"""Non-negative least squares, against SciPy's."""

import numpy as np
import pytest
from compiled import call
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls

from manipnet.synthesis.ik.nnls import unexplained


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 90), st.booleans())
def test_what_is_left_is_what_scipy_leaves(seed, count, one_sided):
    rng = np.random.default_rng(seed)
    columns, wanted = rng.normal(size=(count, 6)), 5.0 * rng.normal(size=6)
    if one_sided:
        columns[:, 2] = np.abs(columns[:, 2])
    left, scale = nnls(columns.T, wanted)[1], float(np.linalg.norm(wanted))
    assert call(unexplained, columns, count, wanted, 1e-9) == pytest.approx(left, abs=1e-4 * scale)


def test_only_the_first_columns_count():
    columns = np.eye(6)
    assert call(unexplained, columns, 3, np.array([1.0, 2.0, 3.0, 0.0, 4.0, 0.0]), 1e-9) == pytest.approx(4.0)


def test_without_columns_all_is_left():
    assert call(unexplained, np.empty((4, 6)), 0, np.array([3.0, 0.0, 4.0, 0.0, 0.0, 0.0]), 1e-9) == pytest.approx(5.0)


def test_columns_that_are_alike_do_no_harm():
    columns = np.tile([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], (40, 1))
    assert call(unexplained, columns, 40, np.array([2.0, 0.0, 0.0, 0.0, 0.0, 1.0]), 1e-9) == pytest.approx(1.0)
