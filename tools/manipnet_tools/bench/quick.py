"""Answers whether this computer is fast enough, in a quarter of a minute and without a reference to compare with."""

import time
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from manipnet.synthesis.model.bundle import Bundle
from manipnet.tracking.tick import TICK_HZ
from manipnet_tools.bench.harness import TickRunner
from manipnet_tools.bench.scenarios import Scenario

BUDGET_MS: Final = 1e3 / TICK_HZ
"""Time between two ticks."""
EASY: Final = 0.5
"""A computer that needs at most this share of the time is fast enough beside a tracker and an engine."""
PACED: Final = 0.75
"""Share of the seconds in which ticks run at their real rate; the others measure how many actors there may be."""
ACTORS: Final = 4


@dataclass(frozen=True)
class Quick:
    """Milliseconds of a tick for both hands of one actor, and how late the system wakes up the program for it."""

    tick_p50_ms: float
    tick_p99_ms: float
    late_p99_ms: float
    actors_p99_ms: float
    """A tick for the hands of `ACTORS` actors."""
    seconds: float

    @property
    def needed(self) -> float:
        """Share of the time between two ticks that 99 % of the ticks need."""
        return (self.tick_p99_ms + self.late_p99_ms) / BUDGET_MS

    @property
    def actors(self) -> int:
        """How many actors this computer has time for."""
        each_ms = max((self.actors_p99_ms - self.tick_p99_ms) / (ACTORS - 1), 1e-3)
        room_ms = EASY * BUDGET_MS - self.late_p99_ms - self.tick_p99_ms
        return max(1 + int(room_ms / each_ms), 0) if room_ms > 0.0 else 0

    def figures(self) -> dict[str, Any]:
        """The figures as plain data."""
        return {**asdict(self), "needed": self.needed, "actors": self.actors, "verdict": verdict(self)}


def measure(bundle: Bundle, scenario: Scenario, seconds: float) -> Quick:
    """Run ticks at 60 Hz, as a server does, and then ticks of several actors one after another."""
    one, several = TickRunner(bundle, scenario), TickRunner(bundle, scenario, ACTORS)
    ticks_ms, late_ms = _paced(one, PACED * seconds)
    actors_ms, end_s = [], time.perf_counter() + (1.0 - PACED) * seconds
    while time.perf_counter() < end_s or len(actors_ms) < 10:
        actors_ms.append(1e3 * sum(several.tick().values()))
    p50_ms, p99_ms = np.percentile(ticks_ms, [50.0, 99.0])
    late_p99_ms, actors_p99_ms = np.percentile(late_ms, 99.0), np.percentile(actors_ms, 99.0)
    return Quick(float(p50_ms), float(p99_ms), float(late_p99_ms), float(actors_p99_ms), seconds)


def _paced(runner: TickRunner, seconds: float) -> tuple[list[float], list[float]]:
    """Milliseconds of each tick, and how late it began, at 60 ticks a second."""
    ticks_ms, late_ms = [], []
    begin_s = time.perf_counter()
    for k in range(1, max(round(seconds * TICK_HZ), 10) + 1):
        due_s = begin_s + k / TICK_HZ
        time.sleep(max(due_s - time.perf_counter(), 0.0))
        late_ms.append(1e3 * max(time.perf_counter() - due_s, 0.0))
        ticks_ms.append(1e3 * sum(runner.tick().values()))
    return ticks_ms, late_ms


def verdict(quick: Quick) -> str:
    """Whether the computer is fast enough, in a sentence."""
    if quick.needed <= EASY:
        room = f"up to {quick.actors} actors" if quick.actors > 1 else "one actor"
        return f"Yes, this computer is fast enough, for {room}."
    if quick.needed <= 1.0:
        return "Only just: this computer keeps up while nothing else uses it; close other programs."
    return "No, this computer is too slow or too busy now: hands would be late or missing."


def lines(quick: Quick, machine: object, about: str) -> list[str]:
    """The report, which ends with the verdict."""
    return [
        f"{machine}",
        f"{about}: a tick for both hands takes {quick.tick_p50_ms:.1f} ms (99 %: {quick.tick_p99_ms:.1f} ms), and "
        f"begins up to {quick.late_p99_ms:.1f} ms late (99 %)",
        f"there are {BUDGET_MS:.1f} ms for each; {ACTORS} actors take {quick.actors_p99_ms:.1f} ms (99 %)",
        verdict(quick),
        "`manipnet bench --full` measures every stage, and a server over its sockets",
    ]
