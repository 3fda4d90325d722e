"""Fuzz the readers of hostile input: `python tests/fuzz/fuzz_run.py [TARGET …] [--cases 200000]`.

Every case may raise only the reader's own error, must take at most a millisecond of the processor, and a good input
is read right after it. One line per target says how many cases, how many were refused, and the slowest.
"""

import argparse
import sys
import time
from dataclasses import dataclass, field

from fuzz_damage import damaged
from fuzz_targets import TARGETS, Target
from hypothesis import HealthCheck, Phase, given, settings

LIMIT_S = 1e-3
REPEATS = 30


@dataclass
class Tally:
    """What came of the cases so far."""

    cases: int = 0
    refused: int = 0
    slowest_s: float = 0.0
    slowest: bytes = field(default=b"", repr=False)


def run_case(target: Target, data: bytes, tally: Tally) -> None:
    """Read one damaged input and a good one; raises what the reader must not."""
    elapsed_s = _timed(target, data, tally)
    for _ in range(REPEATS):  # a busy machine is not the reader's fault: the fastest counts
        if elapsed_s <= LIMIT_S:
            break
        elapsed_s = min(elapsed_s, _timed(target, data, None))
    tally.cases += 1
    if elapsed_s > tally.slowest_s:
        tally.slowest_s, tally.slowest = elapsed_s, data
    target.read(target.good[0])


def _timed(target: Target, data: bytes, tally: Tally | None) -> float:
    start = time.thread_time()
    try:
        target.read(data)
    except target.error:
        if tally is not None:
            tally.refused += 1
    return time.thread_time() - start


def fuzz(name: str, cases: int) -> Tally:
    """`cases` damaged inputs of one target; raises at the first that the reader does not stand."""
    target, tally = TARGETS[name], Tally()

    @settings(
        max_examples=cases,
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(damaged(target.good))
    def stands(data):
        run_case(target, data, tally)

    stands()
    return tally


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("targets", nargs="*", default=list(TARGETS), metavar="TARGET", help=", ".join(TARGETS))
    parser.add_argument("--cases", type=int, default=200_000)
    options = parser.parse_args()
    too_slow = 0
    for name in options.targets:
        start = time.perf_counter()
        tally = fuzz(name, options.cases)
        print(
            f"{name}: {tally.cases} cases, {tally.refused} refused, slowest {1e3 * tally.slowest_s:.2f} ms "
            f"({len(tally.slowest)} bytes), {time.perf_counter() - start:.0f} s",
            flush=True,
        )
        too_slow += tally.slowest_s > LIMIT_S
    return 1 if too_slow else 0


if __name__ == "__main__":
    sys.exit(main())
