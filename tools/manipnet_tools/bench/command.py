"""`manipnet bench`: says whether a computer is fast enough, or measures what a tick costs, stage by stage."""

import json
import sys
from dataclasses import asdict
from typing import Any

from manipnet.synthesis.model.bundle import Bundle, load_bundle
from manipnet_tools.bench import quick
from manipnet_tools.bench.machine import this_machine
from manipnet_tools.bench.options import FULL_S, QUICK_S, USUAL, BenchOptions
from manipnet_tools.bench.scenarios import Scenario, demo, take
from manipnet_tools.takes.meshes import named_files


def run(options: BenchOptions) -> None:
    """Measure, print the report and write the figures. A missed target is not an error.

    Raises `TakeError`, `MeshError`, `BundleError` and `OSError`, and `ModuleNotFoundError` for a full measurement
    without the extra train.
    """
    machine = this_machine()
    bundle = load_bundle(options.model, options.provider)
    scenario = demo() if options.take is None else take(options.take, named_files(options.mesh))
    about = f"{bundle.name} on {scenario.name}"
    if options.is_quick:
        seconds = options.seconds or QUICK_S
        print(f"measuring for {seconds:g} s …", file=sys.stderr, flush=True)
        measured = quick.measure(bundle, scenario, seconds)
        report, figures = quick.lines(measured, machine, about), {"quick": measured.figures()}
    else:
        from manipnet_tools.bench.report import lines

        figures = _sections(options, bundle, scenario)
        report = lines(figures, machine, about)
    if options.json is not None:  # before the report, so that figures that took minutes are kept whatever happens
        content = {"machine": asdict(machine), "model": bundle.name, "performance": scenario.name} | figures
        options.json.write_text(json.dumps(content, indent=1), encoding="utf-8")
    print("\n".join(report))


def _sections(options: BenchOptions, bundle: Bundle, scenario: Scenario) -> dict[str, Any]:
    """The figures of the sections, beside those of the reference."""
    from manipnet_tools.bench.models import full_width
    from manipnet_tools.bench.reference import forward_pass
    from manipnet_tools.bench.report import with_ratios
    from manipnet_tools.bench.sections import MEASURED, Bench

    full = full_width(bundle)
    beside = tuple(load_bundle(model, options.provider) for model in options.beside)
    reference = forward_pass(full.content, full.bundle.layout)
    bench = Bench(bundle, scenario, full, reference, options.seconds or FULL_S, beside)
    figures: dict[str, Any] = {}
    for name in options.only or USUAL:
        print(f"… {name}", file=sys.stderr, flush=True)
        figures[name] = MEASURED[name](bench)
    return with_ratios(figures)
