"""The server's own tick loop without its sockets, fed by a performance and timed stage by stage."""

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
"""Ticks, or passes of the reference, in a row before it is another's turn."""
STAGES = ("windows", "sense", "infer", "ik", "kinematics", "encode")
"""In order: buffers to windows, sensors and features, network, pose and solver, joints in the world, messages."""
TICK = STAGES[:-1]
"""The stages of a tick: all but the encoding for clients."""


class Stopwatch(StageClock):
    """Takes the place of the server's stage clock: seconds of every stage of the newest tick."""

    def __init__(self) -> None:
        super().__init__(Timings())
        self.spent_s: dict[str, float] = {}

    def start(self) -> None:
        """A tick begins."""
        self.spent_s = dict.fromkeys(STAGES, 0.0)
        self._since_s = time.perf_counter()

    def ended(self, stage: str) -> None:
        """What was done since the last call belongs to `stage`."""
        now_s = time.perf_counter()
        self.spent_s[stage] += now_s - self._since_s
        self._since_s = now_s

    def begin(self) -> None:
        """The loop's word for the end of its planning."""
        self.ended("windows")


class Observed(Synthesizer):
    """Remembers what it was asked last."""

    asked: tuple[Sequence[HandScene], Sequence[HandState]] = ((), ())

    def step(self, scenes: Sequence[HandScene], states: Sequence[HandState]) -> list[HandStep]:
        self.asked = scenes, states
        return super().step(scenes, states)


class Rig:
    """A tick loop on a performance, one tick at a time."""

    def __init__(self, bundle: Bundle, performance: Scenario, actors: int = 1) -> None:
        self.watch = Stopwatch()
        self.synthesizer = Observed(bundle, on_stage=self.watch.ended)
        self._frames = endless(performance, actors)
        self._now_s = 0.0
        telemetry = Telemetry()
        telemetry.stages = self.watch
        self._mailbox = Mailbox(telemetry)
        props = [Prop(name, shape.name, shape) for name, shape in performance.shapes.items()]
        self._loop = TickLoop(
            "bench",
            [
                Actor(actor_config(performance, name, actors), props, bundle, telemetry, MAX_LOOK_AHEAD_S)
                for name in actor_names(actors)
            ],
            self.synthesizer,
            self._publish,
            self._mailbox,
            FlightRecorder(Path(tempfile.gettempdir())),
            telemetry,
        )
        for _ in range(WARM_UP_TICKS):
            self.tick()

    def tick(self) -> dict[str, float]:
        """Take frames in until a tick is due, and step it: seconds by stage."""
        while True:
            self.watch.start()
            if self._loop.step(self._now_s):
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


@dataclass(frozen=True)
class Race:
    """Seconds of every tick: `stages[rig][stage] (n,)` and of the reference `(n,)`, from rounds of `TURN` each."""

    stages: Mapping[str, Mapping[str, np.ndarray]]
    reference: np.ndarray

    def total(self, name: str) -> np.ndarray:
        """Whole ticks of a rig `(n,)`, seconds, without the encoding for clients."""
        return np.sum([self.stages[name][stage] for stage in TICK], axis=0)

    def after_others(self, name: str) -> np.ndarray:
        """The first tick of every turn: what ran before has filled the caches with something else."""
        return self.total(name)[::TURN]


def race(rigs: Mapping[str, Rig], reference: Callable[[], object], seconds: float, least_rounds: int = 4) -> Race:
    """Time rigs and reference in short turns: all see the same disturbances, and each mostly finds its own caches."""
    ticks: dict[str, list[dict[str, float]]] = {name: [] for name in rigs}
    passes: list[float] = []
    gc.collect()
    gc.freeze()
    end_s = time.perf_counter() + seconds
    while time.perf_counter() < end_s or len(passes) < TURN * least_rounds:
        for _ in range(TURN):
            start_s = time.perf_counter()
            reference()
            passes.append(time.perf_counter() - start_s)
        for name, rig in rigs.items():
            ticks[name] += [rig.tick() for _ in range(TURN)]
    gc.unfreeze()
    stages = {
        name: {stage: np.array([tick[stage] for tick in of_rig]) for stage in STAGES} for name, of_rig in ticks.items()
    }
    return Race(stages, np.array(passes))


@dataclass(frozen=True)
class Memory:
    """What ticks ask of the allocator: most bytes held at once beyond those before the tick, and kept after it."""

    held_p50: int
    held_max: int
    kept_per_tick: float


def memory(rig: Rig, ticks: int = 200) -> Memory:
    """Trace the allocations of ticks; many times slower than a tick, so never while timing.

    Frames that come in are among them: they are remembered for two seconds.
    """
    tracemalloc.start()
    try:
        held = []
        first, _ = tracemalloc.get_traced_memory()
        for _ in range(ticks):
            before, _ = tracemalloc.get_traced_memory()
            tracemalloc.reset_peak()
            rig.tick()
            held.append(tracemalloc.get_traced_memory()[1] - before)
        last, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    return Memory(int(np.median(held)), max(held), (last - first) / ticks)
