"""Runs damaged inputs through a reader and counts what becomes of them.

A case may raise only the reader's own error, and it should take at most a millisecond of processor time. A case that
takes longer is read up to thirty times and its fastest reading counts, so that what else the machine does is not held
against the reader.
"""

import math
import time
from array import array
from dataclasses import dataclass, field
from random import Random
from typing import Any

import numpy as np
from fuzz_readers import TARGETS, Target

LIMIT_S = 1e-3
REPEATS, GOOD_EVERY = 30, 10


@dataclass
class Tally:
    """The cases so far. `times_s` are the processor times of their first readings."""

    cases: int = 0
    refused: int = 0
    over_limit: int = 0
    slowest_s: float = 0.0
    slowest: bytes = field(default=b"", repr=False)
    times_s: array = field(default_factory=lambda: array("d"), repr=False)

    def __str__(self) -> str:
        p50, p99 = np.percentile(self.times_s, (50, 99))
        return (
            f"{self.cases} cases, {self.refused} refused, median {1e3 * p50:.3f} ms, p99 {1e3 * p99:.3f} ms, "
            f"{self.over_limit} over {1e3 * LIMIT_S:g} ms, slowest {1e3 * self.slowest_s:.2f} ms "
            f"({len(self.slowest)} bytes)"
        )


def fuzz(name: str, cases: float, seed: int, seconds: float = math.inf) -> Tally:
    """Read damaged inputs of a target until there were so many `cases` or so many `seconds` have passed.

    After every tenth case, a good input must be read. Raises `AssertionError`, whose text contains the input, for the
    first input that raises an error which is not the reader's own.
    """
    target, tally, rng = TARGETS[name], Tally(), Random(seed)
    end_s = time.monotonic() + seconds
    while tally.cases < cases and time.monotonic() < end_s:
        data = target.case(rng)
        try:
            _read(target, data, tally)
            if tally.cases % GOOD_EVERY == 0:
                target.read(target.place(target.good[0]))
        except Exception as error:
            raise AssertionError(f"{name}: {type(error).__name__}: {str(error)[:500]}: {data[:2000]!r}") from error
    return tally


def good_s(name: str) -> float:
    """The processor time of the fastest reading of a good input."""
    target = TARGETS[name]
    placed = target.place(target.good[0])
    return min(_timed(target, placed, None) for _ in range(REPEATS))


def _read(target: Target, data: bytes, tally: Tally) -> None:
    placed = target.place(data)
    elapsed_s = _timed(target, placed, tally)
    tally.times_s.append(elapsed_s)
    for _ in range(REPEATS):
        if elapsed_s <= max(LIMIT_S, tally.slowest_s):
            break
        elapsed_s = min(elapsed_s, _timed(target, placed, None))
    tally.cases += 1
    tally.over_limit += elapsed_s > LIMIT_S
    if elapsed_s > tally.slowest_s:
        tally.slowest_s, tally.slowest = elapsed_s, data


def _timed(target: Target, placed: Any, tally: Tally | None) -> float:
    start = time.thread_time()
    try:
        target.read(placed)
    except target.error:
        if tally is not None:
            tally.refused += 1
    return time.thread_time() - start
