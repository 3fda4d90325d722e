"""The working memory of compiled functions, which neither allocate nor count references."""

import os
import subprocess
import sys

import numpy as np
from compiled import call
from numba import types

from manipnet.jit import inner, stack_array

_square, _pair, _counts = stack_array(3, 3), stack_array(2), stack_array(4, dtype=types.int32)


@inner
def _fill_and_sum(values, totals):
    square, pair, other, counts = _square(), _pair(), _pair(), _counts()
    for i in range(3):
        for j in range(3):
            square[i, j] = values[i, j]
    pair[0], pair[1], other[0], other[1] = 10.0, 20.0, 30.0, 40.0
    for i in range(len(counts)):
        counts[i] = i
    for i in range(3):
        for k in range(3):
            totals[i] += square[i, k] + square[k, i]
    totals[3] = pair[0] + 2.0 * pair[1] + 3.0 * other[0] + 4.0 * other[1] + 5.0 * counts[3]
    return square.shape[0] * square.shape[1]


def test_arrays_on_the_stack_are_arrays_of_their_shape_and_do_not_overlap() -> None:
    values, totals = np.arange(9.0).reshape(3, 3), np.zeros(4)
    assert call(_fill_and_sum, values, totals) == 9
    np.testing.assert_array_equal(totals[:3], values.sum(axis=0) + values.sum(axis=1))
    assert totals[3] == 10.0 + 40.0 + 90.0 + 160.0 + 15.0


def test_nothing_allocates_or_counts_references() -> None:
    call(_fill_and_sum, np.zeros((3, 3)), np.zeros(4))
    assert all("NRT_" not in text for text in _fill_and_sum.inspect_llvm().values())


def test_numba_keeps_the_target_even_if_it_was_imported_before_the_kernels() -> None:
    chosen = "import numba, manipnet.jit; from numba.core import config; print(config.CPU_NAME, config.CPU_FEATURES)"
    script = f"{chosen}; config.reload_config(); print(config.CPU_NAME, config.CPU_FEATURES)"
    without = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_DISABLE_ERROR")}
    ran = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, env=without)
    before, after = ran.stdout.splitlines()
    assert before == after
