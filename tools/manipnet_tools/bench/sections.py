"""The sections of `manipnet bench`. Each measures one subject, and returns its figures as a plain dictionary."""

import importlib.util
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import numpy as np

from manipnet.synthesis.model.bundle import Bundle
from manipnet.synthesis.model.features import features
from manipnet.synthesis.objects.shape import build_shape
from manipnet.synthesis.synthesizer import windows_of
from manipnet_tools.bench.cost import CASES, cost_of
from manipnet_tools.bench.harness import STAGES, Race, TickRunner, memory, race
from manipnet_tools.bench.intake import time_cases
from manipnet_tools.bench.live import end_to_end, serving, starts
from manipnet_tools.bench.models import FullWidth, apart_m, quantised, shipped_full_width
from manipnet_tools.bench.options import Section
from manipnet_tools.bench.process_cost import supported
from manipnet_tools.bench.reference import WIDTH
from manipnet_tools.bench.scenarios import Scenario, demo
from manipnet_tools.bench.shapes import gourd

TRIANGLES = (12, 100, 1000, 5000, 20_000, 80_000, 200_000)
ACTORS = (1, 2, 4, 8, 16)
LOOK_AHEADS_S = (0.5, 0.1)
TEN_MINUTES_S = 600.0
TICKS_PER_S = 60.0
STRAIGHTFORWARD = Path(__file__).parents[3] / "benchmarks" / "straightforward.py"
"""Only a checkout has this file; an installed package does not."""

Figures = dict[str, Any]


@dataclass(frozen=True)
class Bench:
    """What the sections measure, and the reference that they compare it with."""

    bundle: Bundle
    scenario: Scenario
    full: FullWidth
    reference: Callable[[], object]
    seconds: float
    """Total time of the timed parts; building, starting and tracing take more."""
    beside: tuple[Bundle, ...] = ()
    """Further models whose ticks are timed."""


def percentiles(seconds: np.ndarray) -> Figures:
    """p50, p99, p99.9 and the maximum in milliseconds."""
    p50, p99, p999 = np.percentile(1e3 * seconds, [50.0, 99.0, 99.9])
    return {"p50_ms": float(p50), "p99_ms": float(p99), "p99.9_ms": float(p999), "max_ms": float(1e3 * seconds.max())}


def _raced(result: Race, name: str) -> Figures:
    """Percentiles of a runner's ticks and of their stages, and their ratios to the median of the reference."""
    p50 = float(np.median(1e3 * result.reference))
    figures = {stage: percentiles(result.stages[name][stage]) for stage in STAGES}
    figures["total"] = percentiles(result.total(name))
    figures["after others"] = percentiles(result.after_others(name))
    for row in figures.values():
        row |= {"p50": row["p50_ms"] / p50, "p99": row["p99_ms"] / p50}
    return figures | {"reference": percentiles(result.reference), "ticks": len(result.reference)}


def tick(bench: Bench) -> Figures:
    """The tick of the chosen model, stage by stage, and the memory that it allocates."""
    runner = TickRunner(bench.bundle, bench.scenario)
    figures = _raced(race({"tick": runner}, bench.reference, 0.25 * bench.seconds), "tick")
    return figures | {"memory": asdict(memory(runner)), "triangles": bench.scenario.triangles}


def models(bench: Bench) -> Figures:
    """The same tick with the paper's width, in single precision and quantised, and with the models given to compare.

    The quantised model is the shipped full-width bundle, or has random weights if none is shipped.
    """
    try:
        random = quantised(bench.full)
    except ModuleNotFoundError as error:
        return {"skipped": f"{error.name} is not installed, which quantises the weights"}
    shipped = shipped_full_width()
    bundles = {"single": bench.full.bundle, "quantised": shipped or random} | {b.name: b for b in bench.beside}
    runners = {name: TickRunner(bundle, bench.scenario) for name, bundle in bundles.items()}
    result = race(runners, bench.reference, 0.15 * bench.seconds)
    rows = np.concatenate([_features_of(runners["single"]) for _ in range(30) if runners["single"].tick()])
    return {name: _raced(result, name) for name in runners} | {
        "weights": "random" if shipped is None else "shipped",
        "quantised_apart_mm": 1e3 * apart_m(bench.full.bundle, random, rows),
    }


def _features_of(runner: TickRunner) -> np.ndarray:
    scenes, states = runner.synthesizer.inputs
    hand = runner.synthesizer.hand
    rows = [
        features(hand, scene.shape, windows_of([scene]), state.positions[None], state.rotations[None])
        for scene, state in zip(scenes, states, strict=True)
    ]
    return np.concatenate(rows)


def triangles(bench: Bench) -> Figures:
    """The same tick with props of 12 to 200,000 triangles, all shaped like a gourd."""
    shapes = {count: build_shape(gourd(count)) for count in TRIANGLES}
    runners = {
        str(count): TickRunner(bench.bundle, bench.scenario.with_shape(shape)) for count, shape in shapes.items()
    }
    result = race(runners, bench.reference, 0.15 * bench.seconds)
    return {name: _raced(result, name) | {"triangles": len(shapes[int(name)].mesh.faces)} for name in runners}


def actors(bench: Bench) -> Figures:
    """The tick of 1 to 16 actors, and how long their hands take from when they fall due.

    All hands are synthesised in one batch, or in two at different instants if there are many actors.
    """
    runners = {str(count): TickRunner(bench.bundle, bench.scenario, count) for count in ACTORS}
    result = race(runners, bench.reference, 0.2 * bench.seconds)
    return {name: _raced(result, name) | {"wait": percentiles(result.waits[name])} for name in runners}


def intake(bench: Bench) -> Figures:
    """One frame of each format that a receiver takes, from its bytes to the frame that the tick thread gets."""
    timed = time_cases(bench.reference, 0.1 * bench.seconds)
    p50_us = {name: float(1e6 * np.median(durations)) for name, durations in timed.items()}
    reference_us = p50_us.pop("reference")
    return {name: {"p50_us": us, "p50": us / reference_us} for name, us in p50_us.items()}


def straightforward(bench: Bench) -> Figures:
    """A tick of the straightforward version at full width, and ours, on the same hands."""
    if not STRAIGHTFORWARD.is_file():
        return {"skipped": "benchmarks/straightforward.py is only in a checkout"}
    try:
        module = _load(STRAIGHTFORWARD)
    except ModuleNotFoundError as error:
        return {"skipped": f"{error.name} is not installed"}
    runner, theirs, ours = TickRunner(bench.bundle, bench.scenario), [], []
    slow: dict[int, Any] = {}
    end_s = time.perf_counter() + 0.1 * bench.seconds
    while time.perf_counter() < end_s or len(theirs) < 3:
        ours += [sum(spent for stage, spent in runner.tick().items() if stage != "encode") for _ in range(60)]
        scenes, states = runner.synthesizer.inputs
        if len({id(scene.shape) for scene in scenes}) != 1 or len(scenes) != 2:
            continue  # the straightforward version handles one mesh and two hands
        mesh = scenes[0].shape.mesh
        version = slow.setdefault(id(mesh), module.Straightforward(mesh.vertices, mesh.faces, WIDTH))
        version.tick(scenes, states)
        start_s = time.perf_counter()
        version.tick(scenes, states)
        theirs.append(time.perf_counter() - start_s)
    times = float(np.median(theirs) / np.median(ours))
    return {"theirs": percentiles(np.array(theirs)), "ours": percentiles(np.array(ours)), "times": times}


def _load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("straightforward", path)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def start(bench: Bench) -> Figures:
    """The start of a real server, with an empty cache and with a full one."""
    return asdict(starts(_model(bench)))


def live(bench: Bench) -> Figures:
    """A real server over its sockets, at two look-aheads, with a full cache."""
    with serving(_model(bench), bench.scenario.meshes, LOOK_AHEADS_S[0]):
        pass
    return {str(look_ahead_s): _served(bench, look_ahead_s, 0.15 * bench.seconds) for look_ahead_s in LOOK_AHEADS_S}


def minutes(bench: Bench) -> Figures:
    """A real server over its sockets for ten minutes."""
    return _served(bench, LOOK_AHEADS_S[0], TEN_MINUTES_S)


def cost(bench: Bench) -> Figures:
    """What a whole server uses per second of stream, beside the reference at 60 Hz."""
    if not supported():
        return {"skipped": "this system does not report what a process uses in /proc"}
    reference = min(_processor_s(bench.reference) for _ in range(5)) * TICKS_PER_S
    figures: Figures = {"reference": reference}
    for case in CASES:
        scenario = demo(case.rate_hz or None)
        row = asdict(cost_of(case, _model(bench), scenario, 0.1 * bench.seconds))
        figures[case.name] = row | {"ratio": row["processor"] / reference}
    return figures


def _processor_s(function: Callable[[], object], times: int = 60) -> float:
    start_s = time.process_time()
    for _ in range(times):
        function()
    return (time.process_time() - start_s) / times


def _served(bench: Bench, look_ahead_s: float, seconds: float) -> Figures:
    result = end_to_end(_model(bench), bench.scenario, look_ahead_s, seconds)
    return {
        "latency": percentiles(result.latency_s),
        "interval": percentiles(result.interval_s),
        "hands": len(result.latency_s),
        "missing": result.missing,
        "resident_mb": result.resident_mb,
        "seconds": seconds,
    }


def _model(bench: Bench) -> str:
    return str(bench.bundle.folder)


MEASURED: Final[Mapping[Section, Callable[[Bench], Figures]]] = {
    "tick": tick,
    "models": models,
    "triangles": triangles,
    "actors": actors,
    "intake": intake,
    "straightforward": straightforward,
    "start": start,
    "live": live,
    "minutes": minutes,
    "cost": cost,
}
"""What measures each section."""
