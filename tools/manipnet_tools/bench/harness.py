"""Times the stages of the server's own tick loop, without its sockets, on the frames of a scenario."""

import gc
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from manipnet.actors.actor import Actor
from manipnet.actors.props import Prop
from manipnet.actors.spread import start_delays_s
from manipnet.runtime.avatars import Avatars
from manipnet.runtime.flight_recorder import FlightRecorder
from manipnet.runtime.mailbox import Mailbox
from manipnet.runtime.tick_loop import TickLoop
from manipnet.synthesis.model.bundle import Bundle
from manipnet.synthesis.model.providers import MAX_LOOK_AHEAD_S
from manipnet.synthesis.synthesizer import HandScene, HandState, HandStep, Synthesizer
from manipnet.telemetry import StageClock, Telemetry, Timings
from manipnet.wire import HandsMessage, encode_binary, encode_msgpack
from manipnet_tools.bench.scenarios import Scenario, actor_config, actor_names, endless

WARM_UP_TICKS = 90
TURN = 10
"""How many ticks, or passes of the reference, are timed in a row before the next one has its turn."""
STAGES = ("windows", "sense", "infer", "ik", "kinematics", "encode")
"""In order: poses to windows, sensors and features, network, pose and solver, joints in the world, messages."""
TICK = STAGES[:-1]
"""The stages of a tick: all but the encoding for clients."""


class Stopwatch(StageClock):
    """Replaces the server's stage clock, and keeps the duration of every stage of the latest tick."""

    def __init__(self) -> None:
        super().__init__(Timings())
        self.spent_s: dict[str, float] = {}

    def start(self) -> None:
        """Begin a tick."""
        self.spent_s = dict.fromkeys(STAGES, 0.0)
        self._since_s = time.perf_counter()

    def ended(self, stage: str) -> None:
        """Add the time since the last call to `stage`."""
        now_s = time.perf_counter()
        self.spent_s[stage] += now_s - self._since_s
        self._since_s = now_s

    def begin(self) -> None:
        """The tick loop calls this when its planning ends."""
        self.ended("windows")


class ObservedSynthesizer(Synthesizer):
    """A synthesizer that keeps its latest inputs."""

    inputs: tuple[Sequence[HandScene], Sequence[HandState]] = ((), ())

    def step(self, scenes: Sequence[HandScene], states: Sequence[HandState]) -> list[HandStep]:
        self.inputs = scenes, states
        return super().step(scenes, states)


class TickRunner:
    """Runs a tick loop on the frames of a scenario, one tick at a time."""

    def __init__(self, bundle: Bundle, scenario: Scenario, actors: int = 1, avatars: Avatars | None = None) -> None:
        self.watch = Stopwatch()
        self.synthesizer = ObservedSynthesizer(bundle, on_stage=self.watch.ended)
        self._frames = endless(scenario, actors)
        self._now_s = 0.0
        telemetry = Telemetry()
        telemetry.stages = self.watch
        self._mailbox = Mailbox(telemetry)
        props = [Prop(name, shape.name, shape) for name, shape in scenario.shapes.items()]
        configs = [actor_config(scenario, name, actors) for name in actor_names(actors)]
        self._actors, self._published = actors, 0
        self.waits_s: list[float] = []
        """For each batch of the latest tick, how long its hands would have taken in real time, from when they fell due:
        the whole batch, and what was left of the batch before it."""
        self._free_s = 0.0
        """Stream time at which the loop would have been ready for the next batch."""
        self._loop = TickLoop(
            "bench",
            [
                Actor(config, props, bundle, telemetry, MAX_LOOK_AHEAD_S, delay_s)
                for config, delay_s in zip(configs, start_delays_s(configs), strict=True)
            ],
            self.synthesizer,
            self._publish,
            self._mailbox,
            FlightRecorder(Path(tempfile.gettempdir())),
            telemetry,
            avatars=avatars,
        )
        for _ in range(WARM_UP_TICKS):
            self.tick()

    def tick(self) -> dict[str, float]:
        """Feed frames until every actor has ticked. Returns the duration of each stage in seconds.

        Many actors tick in several batches at different instants, whose durations are added up.
        """
        spent_s: dict[str, float] = dict.fromkeys(STAGES, 0.0)
        self.waits_s, self._published = [], 0
        while self._published < self._actors:
            for stage, seconds in self._batch().items():
                spent_s[stage] += seconds
        return spent_s

    def _batch(self) -> dict[str, float]:
        """Feed frames until a tick is due, and run it."""
        while True:
            self.watch.start()
            if self._loop.step(self._now_s):
                self._free_s = max(self._free_s, self._now_s) + sum(self.watch.spent_s.values())
                self.waits_s.append(self._free_s - self._now_s)
                return self.watch.spent_s
            frame = next(self._frames)
            self._now_s = frame.t_s
            self._mailbox.put(frame)
            self._loop.take_in(0.0)

    def _publish(self, message: HandsMessage) -> None:
        self.watch.ended("kinematics")
        encode_msgpack(message)
        encode_binary(message)
        self.watch.ended("encode")
        self._published += 1


@dataclass(frozen=True)
class Race:
    """Durations in seconds: `stages[runner][stage] (n,)` of every tick, `(n,)` of every pass of the reference, and
    `waits[runner] (m,)` from when the hands of each batch fell due until they were encoded."""

    stages: Mapping[str, Mapping[str, np.ndarray]]
    waits: Mapping[str, np.ndarray]
    reference: np.ndarray

    def total(self, name: str) -> np.ndarray:
        """Durations `(n,)` of the whole ticks of a runner in seconds, without the encoding for clients."""
        return np.sum([self.stages[name][stage] for stage in TICK], axis=0)

    def after_others(self, name: str) -> np.ndarray:
        """The first tick of every turn, for which the processor's caches hold the data of other runners."""
        return self.total(name)[::TURN]


def race(
    runners: Mapping[str, TickRunner], reference: Callable[[], object], seconds: float, least_rounds: int = 4
) -> Race:
    """Time runners and the reference in short turns.

    So all meet the same disturbances, and each mostly finds its own data in the processor's caches.
    """
    ticks: dict[str, list[dict[str, float]]] = {name: [] for name in runners}
    waits: dict[str, list[float]] = {name: [] for name in runners}
    passes: list[float] = []
    gc.collect()
    gc.freeze()
    end_s = time.perf_counter() + seconds
    while time.perf_counter() < end_s or len(passes) < TURN * least_rounds:
        for _ in range(TURN):
            start_s = time.perf_counter()
            reference()
            passes.append(time.perf_counter() - start_s)
        for name, runner in runners.items():
            for _ in range(TURN):
                ticks[name].append(runner.tick())
                waits[name] += runner.waits_s
    gc.unfreeze()
    stages = {
        name: {stage: np.array([tick[stage] for tick in of_runner]) for stage in STAGES}
        for name, of_runner in ticks.items()
    }
    return Race(stages, {name: np.array(of_runner) for name, of_runner in waits.items()}, np.array(passes))


@dataclass(frozen=True)
class Memory:
    """Bytes that ticks allocate: the most at once beyond those before the tick, and those that are kept after it."""

    held_p50: int
    held_max: int
    kept_per_tick: float


def memory(runner: TickRunner, ticks: int = 200) -> Memory:
    """Trace the allocations of ticks, which makes them many times slower, so this is never done while timing.

    The frames that arrive count too, because the tick loop keeps them for two seconds.
    """
    tracemalloc.start()
    try:
        held = []
        first, _ = tracemalloc.get_traced_memory()
        for _ in range(ticks):
            before, _ = tracemalloc.get_traced_memory()
            tracemalloc.reset_peak()
            runner.tick()
            held.append(tracemalloc.get_traced_memory()[1] - before)
        last, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    return Memory(int(np.median(held)), max(held), (last - first) / ticks)
