"""Fuzz the readers of hostile input: `python tests/fuzz/fuzz_run.py [TARGET …] [--cases 200000] [--minutes …]`.

Every case may raise only the reader's own error and should take at most a millisecond of the processor; after every
tenth a good input must be read. A case over a millisecond is read again up to thirty times and the fastest counts: what
the machine did meanwhile is not the reader's fault. One line per target says how many cases, how many were refused, the
processor time of a case when first read (median, 99 %), the slowest of them by its fastest reading, and the good one's.
"""

import argparse
import logging
import math
import sys
import time
from array import array
from dataclasses import dataclass, field
from random import Random
from typing import Any

import numpy as np
from fuzz_targets import TARGETS, Target

LIMIT_S = 1e-3
REPEATS, GOOD_EVERY = 30, 10


@dataclass
class Tally:
    """What came of the cases so far. `times_s` are those of the first readings."""

    cases: int = 0
    refused: int = 0
    over_limit: int = 0
    slowest_s: float = 0.0
    slowest: bytes = field(default=b"", repr=False)
    times_s: array = field(default_factory=lambda: array("d"), repr=False)


def run_case(target: Target, data: bytes, tally: Tally) -> None:
    """Read one damaged input; raises what the reader must not."""
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


def fuzz(name: str, cases: int, seed: int = 1, seconds: float = math.inf) -> Tally:
    """`cases` damaged inputs of one target, or as many as there is time for.

    Raises `AssertionError`, which holds the input, at the first that the reader does not stand.
    """
    target, tally, rng = TARGETS[name], Tally(), Random(seed)
    end_s = time.monotonic() + seconds
    while tally.cases < cases and time.monotonic() < end_s:
        data = target.case(rng)
        try:
            run_case(target, data, tally)
            if tally.cases % GOOD_EVERY == 0:
                target.read(target.place(target.good[0]))
        except Exception as error:
            raise AssertionError(f"{name}: {type(error).__name__}: {str(error)[:500]}: {data[:2000]!r}") from error
    return tally


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("targets", nargs="*", default=list(TARGETS), metavar="TARGET", help=", ".join(TARGETS))
    parser.add_argument("--cases", type=int, default=200_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=math.inf, help="for each target at most")
    options = parser.parse_args()
    logging.disable()  # warnings of damage are what is asked for
    too_slow = 0
    for name in options.targets:
        start = time.perf_counter()
        tally = fuzz(name, options.cases, options.seed, 60.0 * options.minutes)
        p50, p99 = np.percentile(tally.times_s, (50, 99))
        target = TARGETS[name]
        good = target.place(target.good[0])
        good_s = min(_timed(target, good, None) for _ in range(REPEATS))
        print(
            f"{name}: {tally.cases} cases, {tally.refused} refused, median {1e3 * p50:.3f} ms, p99 {1e3 * p99:.3f} ms, "
            f"{tally.over_limit} over {1e3 * LIMIT_S:g} ms, slowest {1e3 * tally.slowest_s:.2f} ms "
            f"({len(tally.slowest)} bytes), good {1e3 * good_s:.3f} ms, seed {options.seed}, "
            f"{time.perf_counter() - start:.0f} s",
            flush=True,
        )
        too_slow += tally.over_limit > 0
    return 1 if too_slow else 0


if __name__ == "__main__":
    sys.exit(main())
