"""Measure all figures of docs/performance.md again and write them into it: `python benchmarks/performance_page.py`.

This takes about 17 minutes, on a machine that should do nothing else. The usual sections are written after about five
minutes; the session of ten minutes comes last. The complete figures are written as JSON to the current folder. All
options go to `manipnet bench`, whose `--help` lists them.
"""

import argparse
import re
import subprocess
import sys
from pathlib import Path

from manipnet_tools.bench.options import USUAL

PAGE = Path(__file__).parents[1] / "docs" / "performance.md"


def measure(name: str, sections: tuple[str, ...], options: list[str]) -> None:
    """Run some sections of `manipnet bench` and write its output into its place in the page."""
    command = ["manipnet", "bench", *(word for section in sections for word in ("--only", section))]
    command += ["--json", f"bench-{name}.json", *options]
    print(" ".join(command), flush=True)
    report = subprocess.run(
        [sys.executable, "-m", "manipnet_tools.cli", *command[1:]], stdout=subprocess.PIPE, text=True, check=True
    ).stdout
    print(report, flush=True)
    block = f"<!-- {name} -->\n```\n{report.strip()}\n```\n<!-- end of {name} -->"
    page = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(
        re.sub(f"<!-- {name} -->.*<!-- end of {name} -->", lambda _: block, page, flags=re.S), encoding="utf-8"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    _, options = parser.parse_known_args()
    measure("usual", USUAL, options)
    measure("minutes", ("minutes",), options)


if __name__ == "__main__":
    main()
