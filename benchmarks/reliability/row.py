"""Rows of `docs/reliability.md`: what was measured, the target, the result, and the machine."""

import argparse
import json
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from manipnet_tools.bench.machine import this_machine


@dataclass(frozen=True)
class Row:
    """One measurement. `met` is None if there is no target."""

    test: str
    target: str
    measured: str
    met: bool | None
    details: Mapping[str, Any]


def parser(text: str | None, seconds: float | None) -> argparse.ArgumentParser:
    """A parser with the options of all measurements; without `seconds` the duration cannot be chosen."""
    result = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    if seconds is not None:
        result.add_argument("--seconds", type=float, default=seconds, help="how long to measure (default: %(default)g)")
    result.add_argument("--seed", type=int, default=1, help="of the random numbers (default: %(default)d)")
    result.add_argument(
        "--out", type=Path, default=Path("build/reliability"), metavar="FOLDER", help="where to write the JSON"
    )
    return result


def report(name: str, rows: list[Row], folder: Path) -> None:
    """Print the rows and write them to `folder/NAME.json`."""
    machine = this_machine()
    command = f"python -m benchmarks.reliability.{name} {' '.join(sys.argv[1:])}".strip()
    folder.mkdir(parents=True, exist_ok=True)
    content = {"command": command, "machine": asdict(machine), "rows": [asdict(row) for row in rows]}
    (folder / f"{name}.json").write_text(json.dumps(content, indent=1, default=float), encoding="utf-8")
    print(f"{command}\n{machine}")
    for row in rows:
        verdict = {True: "met", False: "MISSED", None: "-"}[row.met]
        print(f"| {row.test} | {row.target} | {row.measured} | {verdict} |")
