"""The command line of `manipnet bench`."""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from manipnet.synthesis.model.bundle import load_bundle
from manipnet.synthesis.model.providers import DEFAULT_MODEL, PROVIDERS
from manipnet_tools.bench.machine import this_machine
from manipnet_tools.bench.models import full_width
from manipnet_tools.bench.reference import forward_pass
from manipnet_tools.bench.report import lines, with_ratios
from manipnet_tools.bench.scenarios import Scenario, demo, take
from manipnet_tools.bench.sections import SECTIONS, USUAL, Bench, Figures
from manipnet_tools.takes.take import TakeError


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print, write; 0 whether targets are met or not: it is a measurement, not a test."""
    arguments = build_parser().parse_args(argv)
    machine = this_machine()
    bundle = load_bundle(arguments.model, arguments.provider)
    full = full_width(bundle)
    performance = _performance(arguments.take, arguments.mesh)
    beside = tuple(load_bundle(model, arguments.provider) for model in arguments.beside)
    bench = Bench(bundle, performance, full, forward_pass(full.content, full.bundle.layout), arguments.seconds, beside)
    figures: Figures = {}
    for name in arguments.only or USUAL:
        print(f"… {name}", file=sys.stderr, flush=True)
        figures[name] = SECTIONS[name](bench)
    figures = with_ratios(figures)
    about = f"{bundle.name} on {performance.name}"
    print("\n".join(lines(figures, machine, about)))
    if arguments.json is not None:
        content = {"machine": asdict(machine), "model": bundle.name, "performance": performance.name} | figures
        arguments.json.write_text(json.dumps(content, indent=1), encoding="utf-8")
    return 0


def build_parser() -> argparse.ArgumentParser:
    """The options of `manipnet bench`."""
    parser = argparse.ArgumentParser(prog="manipnet bench", description=__doc__)
    parser.add_argument("--take", type=Path, metavar="TAKE", help="measure on this take instead of the bundled demo")
    parser.add_argument(
        "--mesh", action="append", default=[], metavar="NAME=FILE", help="mesh of the take's object NAME; repeatable"
    )
    parser.add_argument("--model", default=DEFAULT_MODEL, help="a shipped model, or the folder of one (%(default)s)")
    parser.add_argument(
        "--beside", action="append", default=[], metavar="MODEL", help="time ticks of this model too; repeatable"
    )
    parser.add_argument("--provider", choices=PROVIDERS, default="cpu", help="what models run on (%(default)s)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures here too")
    parser.add_argument(
        "--seconds", type=float, default=100.0, help="of timing in all; building and starting come on top (%(default)s)"
    )
    parser.add_argument(
        "--only", action="append", choices=SECTIONS, help="measure this section alone; repeatable; `minutes` takes ten"
    )
    return parser


def _performance(path: Path | None, meshes: Sequence[str]) -> Scenario:
    if path is None:
        return demo()
    files = {}
    for text in meshes:
        name, separator, file = text.partition("=")
        if not separator:
            raise TakeError(f"--mesh {text} must be NAME=FILE")
        files[name] = Path(file)
    return take(path, files)
