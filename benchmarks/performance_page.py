"""All figures of docs/performance.md, measured anew: `python benchmarks/performance_page.py`, about 17 minutes.

Run it on a machine that does nothing else. The usual sections come first and are in the page after some five minutes,
the ten minutes of a session last. The figures in full are left in the folder it is run in.
"""

import re
import subprocess
import sys
from pathlib import Path

from manipnet_tools.bench.sections import USUAL

PAGE = Path(__file__).parents[1] / "docs" / "performance.md"


def measure(name: str, sections: tuple[str, ...]) -> None:
    """Run some sections of `manipnet bench` and put what it prints into its place in the page."""
    command = ["manipnet", "bench", *(word for section in sections for word in ("--only", section))]
    command += ["--json", f"bench-{name}.json", *sys.argv[1:]]
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


if __name__ == "__main__":
    measure("usual", USUAL)
    measure("minutes", ("minutes",))
