"""`manipnet bench`: measures what a tick costs, stage by stage, beside a reference measured in the same run."""

import json
import sys
from dataclasses import asdict

from manipnet.synthesis.model.bundle import load_bundle
from manipnet_tools.bench.machine import this_machine
from manipnet_tools.bench.models import full_width
from manipnet_tools.bench.options import USUAL, BenchOptions
from manipnet_tools.bench.reference import forward_pass
from manipnet_tools.bench.report import lines, with_ratios
from manipnet_tools.bench.scenarios import demo, take
from manipnet_tools.bench.sections import MEASURED, Bench, Figures
from manipnet_tools.takes.meshes import named_files


def run(options: BenchOptions) -> None:
    """Measure, print the report and write the figures. A missed target is not an error.

    Raises `TakeError`, `MeshError`, `BundleError` and `OSError`.
    """
    machine = this_machine()
    bundle = load_bundle(options.model, options.provider)
    full = full_width(bundle)
    scenario = demo() if options.take is None else take(options.take, named_files(options.mesh))
    beside = tuple(load_bundle(model, options.provider) for model in options.beside)
    bench = Bench(bundle, scenario, full, forward_pass(full.content, full.bundle.layout), options.seconds, beside)
    figures: Figures = {}
    for name in options.only or USUAL:
        print(f"… {name}", file=sys.stderr, flush=True)
        figures[name] = MEASURED[name](bench)
    figures = with_ratios(figures)
    print("\n".join(lines(figures, machine, f"{bundle.name} on {scenario.name}")))
    if options.json is not None:
        content = {"machine": asdict(machine), "model": bundle.name, "performance": scenario.name} | figures
        options.json.write_text(json.dumps(content, indent=1), encoding="utf-8")
