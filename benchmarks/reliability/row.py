"""A figure of `docs/reliability.md`: what was measured, how, against what, on which machine."""

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
    """One measurement. `met` is None where the target says nothing about it."""

    test: str
    target: str
    measured: str
    met: bool | None
    details: Mapping[str, Any]


def parser(text: str | None, seconds: float) -> argparse.ArgumentParser:
    """The options that every measurement has."""
    result = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument("--seconds", type=float, default=seconds, help="how long to measure (default: %(default)g)")
    result.add_argument("--seed", type=int, default=1)
    result.add_argument("--out", type=Path, default=Path("build/reliability"), metavar="FOLDER", help="for the JSON")
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
