"""Non-negative least squares in six dimensions: whether contact forces can add up to a wrench.

Source: Lawson and Hanson, Solving Least Squares Problems, chapter 23. At most six columns are in use at a time, so that
every step is a small Cholesky solve.
"""

import numpy as np

from manipnet.geometry import Array
from manipnet.jit import inner, stack_array

SIZE = 6
_MOST_STEPS = 24
_RIDGE = 1e-9
"""Keeps the squares positive definite where two columns are alike."""
_used, _shares, _trial, _rest = stack_array(SIZE), stack_array(SIZE), stack_array(SIZE), stack_array(SIZE)
_square = stack_array(SIZE, SIZE)


@inner
def _fit(columns: Array, used: Array, count: int, wanted: Array, square: Array, trial: Array):
    """Fit the `count` columns in use to `wanted (6,)` without bounds; their shares go into `trial (6,)`."""
    for a in range(count):
        i = int(used[a])
        trial[a] = 0.0
        for k in range(SIZE):
            trial[a] += columns[i, k] * wanted[k]
        for b in range(a + 1):
            j = int(used[b])
            total = _RIDGE if a == b else 0.0
            for k in range(SIZE):
                total += columns[i, k] * columns[j, k]
            for k in range(b):
                total -= square[a, k] * square[b, k]
            square[a, b] = np.sqrt(max(total, 1e-18)) if a == b else total / square[b, b]
        for k in range(a):
            trial[a] -= square[a, k] * trial[k]
        trial[a] /= square[a, a]
    for a in range(count - 1, -1, -1):
        for k in range(a + 1, count):
            trial[a] -= square[k, a] * trial[k]
        trial[a] /= square[a, a]


@inner
def _steepest(columns: Array, count: int, rest: Array, used: Array, held: int, least: float):
    """The unused column that reduces `rest (6,)` fastest, or -1 if none does by more than `least`."""
    best = -1
    for n in range(count):
        slope = 0.0
        for k in range(SIZE):
            slope += columns[n, k] * rest[k]
        if slope > least:
            best, least = n, slope
    for a in range(held):
        if int(used[a]) == best:
            return -1
    return best


@inner
def _drop_negative(used: Array, share: Array, trial: Array, held: int):
    """Go from `share` toward `trial` until a share is zero, and drop that column.

    Returns how many columns are left and whether `trial` was reached.
    """
    step = 1.0
    for a in range(held):
        if trial[a] <= 0.0:
            step = min(step, share[a] / max(share[a] - trial[a], 1e-12))
    kept = 0
    for a in range(held):
        share[a] += step * (trial[a] - share[a])
    if step >= 1.0:
        return held, True
    for a in range(held):
        if share[a] > 1e-9:
            used[kept], share[kept] = used[a], share[a]
            kept += 1
    return kept, False


@inner
def unexplained(columns: Array, count: int, wanted: Array, enough: float):
    """Length of the part of `wanted (6,)` that no non-negative mix of the first `count` of `columns (N, 6)` supplies.

    The search ends early when that length is below `enough`.
    """
    used, share, trial, square, rest = _used(), _shares(), _trial(), _square(), _rest()
    held, length = 0, 0.0
    for k in range(SIZE):
        rest[k] = wanted[k]
        length += wanted[k] ** 2
    length = np.sqrt(length)
    for _ in range(_MOST_STEPS):
        if length < enough or held == SIZE:
            break
        best = _steepest(columns, count, rest, used, held, 1e-6 * length)
        if best < 0:
            break
        used[held], share[held] = best, 0.0
        held += 1
        reached = False
        while held > 0 and not reached:
            _fit(columns, used, held, wanted, square, trial)
            held, reached = _drop_negative(used, share, trial, held)
        length = 0.0
        for k in range(SIZE):
            rest[k] = wanted[k]
            for a in range(held):
                rest[k] -= share[a] * columns[int(used[a]), k]
            length += rest[k] ** 2
        length = np.sqrt(length)
    return length
