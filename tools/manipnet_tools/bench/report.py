"""Prints the figures of a run as tables, and compares them with the goals."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from manipnet_tools.bench.harness import STAGES, TURN
from manipnet_tools.bench.machine import Machine

Figures = dict[str, Any]
_SHOWN = ("sense", "infer", "ik")


@dataclass(frozen=True)
class Goal:
    """A figure's place in the results, and the bound that it must not exceed, or must reach if `at_least`."""

    what: str
    place: tuple[str, ...]
    bound: float
    unit: str = "x"
    at_least: bool = False


GOALS = (
    Goal("tick, chosen model: p50", ("tick", "total", "p50"), 0.5),
    Goal("tick, chosen model: p99", ("tick", "total", "p99"), 1.0),
    Goal("tick at 5k triangles: p50", ("triangles", "5000", "total", "p50"), 0.5),
    Goal("tick at 5k triangles: p99", ("triangles", "5000", "total", "p99"), 1.0),
    Goal("tick, full width quantised: p50", ("models", "quantised", "total", "p50"), 0.6),
    Goal("tick, full width quantised: p99", ("models", "quantised", "total", "p99"), 1.2),
    Goal("sensors: p50", ("tick", "sense", "p50"), 0.2),
    Goal("inverse kinematics: p50", ("tick", "ik", "p50"), 0.1),
    Goal("200k triangles over 5k", ("ratios", "200k triangles"), 1.3),
    Goal("8 actors over 1", ("ratios", "8 actors"), 3.0),
    Goal("16 actors, due to out: p99", ("actors", "16", "wait", "p99_ms"), 4.0, "ms"),
    Goal("straightforward version over ours", ("straightforward", "times"), 20.0, at_least=True),
    Goal("end to end beyond look-ahead 0.5 s: p99", ("live", "0.5", "latency", "p99_ms"), 1e3 / 60.0, "ms"),
    Goal("end to end beyond look-ahead 0.1 s: p99", ("live", "0.1", "latency", "p99_ms"), 1e3 / 60.0, "ms"),
    Goal("published interval: p99", ("live", "0.5", "interval", "p99_ms"), 18.5, "ms"),
    Goal("hands missing", ("live", "0.5", "missing"), 0.0, ""),
    Goal("ready, warm cache", ("start", "warm_s"), 3.0, "s"),
    Goal("ready, empty cache", ("start", "cold_s"), 12.0, "s"),
    Goal("ten minutes, published interval: p99", ("minutes", "interval", "p99_ms"), 18.5, "ms"),
    Goal("ten minutes, hands missing", ("minutes", "missing"), 0.0, ""),
    Goal("resident memory, one actor", ("live", "0.5", "resident_mb"), 350.0, "MB"),
    Goal("processor, one actor at 120 Hz", ("cost", "one actor, 120 Hz", "processor"), 0.06, "cores"),
    Goal("processor, 8 actors", ("cost", "8 actors", "processor"), 0.25, "cores"),
    Goal("own memory, one actor", ("cost", "one actor, 120 Hz", "own_mb"), 120.0, "MB"),
)


def with_ratios(figures: Figures) -> Figures:
    """The figures, with the ratios of some of them added."""
    ratios = {}
    for name, section, one, other in (
        ("200k triangles", "triangles", "200000", "5000"),
        ("8 actors", "actors", "8", "1"),
    ):
        a, b = (_find(figures, (section, which, "total", "p50_ms")) for which in (one, other))
        if a is not None and b is not None:
            ratios[name] = a / b
    return figures | {"ratios": ratios}


def verdicts(figures: Figures) -> list[tuple[Goal, float, bool]]:
    """Every goal that was measured, with its figure and whether it is met."""
    found = [(goal, _find(figures, goal.place)) for goal in GOALS]
    return [
        (goal, value, value >= goal.bound if goal.at_least else value <= goal.bound)
        for goal, value in found
        if value is not None
    ]


def _find(figures: Figures, place: Iterable[str]) -> float | None:
    value: Any = figures
    for key in place:
        if not isinstance(value, dict) or key not in value:
            return None
        value = value[key]
    return value


def lines(figures: Figures, machine: Machine, about: str) -> Iterator[str]:
    """The lines of the report. Ratios are relative to the median of the reference in the same section."""
    yield f"{machine}"
    yield f"{about}; reference: the 1536 wide network alone, single precision, two hands, one thread"
    if "total" in figures.get("tick", {}):
        yield from _stages(figures["tick"])
    for section, title in (("models", "full width"), ("triangles", "triangles"), ("actors", "actors")):
        yield from _totals(title, figures.get(section, {}))
    yield from _intake(figures.get("intake", {}))
    yield from _straightforward(figures.get("straightforward", {}))
    yield from _process(figures)
    yield from _cost(figures.get("cost", {}))
    yield ""
    for goal, value, met in verdicts(figures):
        sign = ">=" if goal.at_least else "<="
        yield f"{'met   ' if met else 'MISSED'}  {goal.what:42} {value:9.3g} {sign} {goal.bound:.3g} {goal.unit}"


def _stages(tick: Figures) -> Iterator[str]:
    yield f"\none actor, {tick['triangles']} triangles, {tick['ticks']} ticks in turns of {TURN} with the reference"
    yield f"{'':12} {'p50 ms':>8} {'p99':>8} {'p99.9':>8} {'max':>8}   {'p50 / ref':>9} {'p99 / ref':>9}"
    for name in (*STAGES[:-1], "total", "after others", "encode", "reference"):
        row = tick[name]
        ratios = f"   {row['p50']:9.3f} {row['p99']:9.3f}" if "p50" in row else ""
        yield f"{name:12} " + " ".join(f"{row[k]:8.3f}" for k in ("p50_ms", "p99_ms", "p99.9_ms", "max_ms")) + ratios
    memory = tick["memory"]
    yield (
        f"allocated per tick: {memory['held_p50'] / 1e3:.0f} kB held at once (at most {memory['held_max'] / 1e3:.0f}), "
        f"{memory['kept_per_tick'] / 1e3:.1f} kB kept"
    )


def _totals(title: str, section: Figures) -> Iterator[str]:
    if not section:
        return
    if "skipped" in section:
        yield f"\n{title}: {section['skipped']}"
        return
    raced = {name: figures for name, figures in section.items() if isinstance(figures, dict)}
    waits = any("wait" in figures for figures in raced.values())
    head = f"\n{title:12} {'p50 ms':>8} {'p99':>8}   {'p50 / ref':>9} {'p99 / ref':>9}   " + "  ".join(_SHOWN)
    yield head + ("     due to out: p50 ms  p99" if waits else "")
    for name, figures in raced.items():
        total, stages = figures["total"], " ".join(f"{figures[s]['p50']:6.3f}" for s in _SHOWN)
        wait = f"{figures['wait']['p50_ms']:19.3f} {figures['wait']['p99_ms']:8.3f}" if waits else ""
        yield (
            f"{name:12} {total['p50_ms']:8.3f} {total['p99_ms']:8.3f}   "
            f"{total['p50']:9.3f} {total['p99']:9.3f}   {stages}{wait}"
        )
    if "weights" in section:
        apart_mm = section["quantised_apart_mm"]
        yield f"quantised: {section['weights']} weights; random ones put joints at most {apart_mm:.2f} mm apart"


def _intake(section: Figures) -> Iterator[str]:
    if section:
        yield f"\n{'a frame of bodies':24} {'p50 us':>8}   {'p50 / ref':>9}"
        for name, row in section.items():
            yield f"{name:24} {row['p50_us']:8.1f}   {row['p50']:9.4f}"


def _straightforward(section: Figures) -> Iterator[str]:
    if "skipped" in section:
        yield f"\nstraightforward version: {section['skipped']}"
    elif section:
        theirs, ours = section["theirs"]["p50_ms"], section["ours"]["p50_ms"]
        yield f"\nstraightforward version: {theirs:.0f} ms a tick, ours {ours:.3f} ms: {section['times']:.0f} times"


def _cost(section: Figures) -> Iterator[str]:
    if "skipped" in section:
        yield f"\ncost of a running server: {section['skipped']}"
    elif section:
        yield (
            f"\n{'a running server':20} {'core %':>7} {'/ ref':>7} {'wake-ups/s':>11} {'own MB':>7} {'resident':>9}"
            f"   (reference at 60 Hz: {100 * section['reference']:.1f} % of a core)"
        )
        for name, row in section.items():
            if isinstance(row, dict):
                size = "" if row["resident_mb"] is None else f"{row['resident_mb']:9.0f}"
                yield (
                    f"{name:20} {100 * row['processor']:7.1f} {row['ratio']:7.2f} {row['wake_ups']:11.0f} "
                    f"{row['own_mb']:7.0f} {size}"
                )


def _process(figures: Figures) -> Iterator[str]:
    if start := figures.get("start"):
        yield ""
        for name, cache in (("cold", "an empty"), ("warm", "a full")):
            size = start[f"{name}_mb"]
            yield f"ready after {start[f'{name}_s']:.1f} s with {cache} cache" + (f", {size:.0f} MB" if size else "")
    served = {f"look-ahead {look_ahead} s": row for look_ahead, row in figures.get("live", {}).items()}
    if "minutes" in figures:
        served["ten minutes"] = figures["minutes"]
    for what, row in served.items():
        latency, interval = row["latency"], row["interval"]
        size = f", {row['resident_mb']:.0f} MB resident" if row["resident_mb"] else ""
        yield (
            f"{what}, {row['hands']} hands over sockets: last packet needed to hands received p50 "
            f"{latency['p50_ms']:.2f}, p99 {latency['p99_ms']:.2f}, max {latency['max_ms']:.2f} ms; interval p50 "
            f"{interval['p50_ms']:.2f}, p99 {interval['p99_ms']:.2f}, max {interval['max_ms']:.2f} ms; "
            f"{row['missing']} missing{size}"
        )
