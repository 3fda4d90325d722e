"""Run the measurements of docs/reliability.md one after another, and print the load before each.

`python -m benchmarks.reliability.everything` runs all but the soak and the fuzz tests, in about 50 minutes. Names
choose some of them; those marked with * measure milliseconds, so nothing else may run on the machine meanwhile.
"""

import argparse
import os
import subprocess
import sys
import time
from dataclasses import dataclass

from benchmarks.support import ROOT


@dataclass(frozen=True)
class Measurement:
    """The arguments of Python, about how many minutes it takes, and whether it needs a quiet machine."""

    arguments: tuple[str, ...]
    minutes: int
    quiet: bool = False


def _module(name: str, *options: str) -> tuple[str, ...]:
    return "-m", f"benchmarks.reliability.{name}", *options


MEASUREMENTS = {
    "clock": Measurement(_module("clock"), 2, quiet=True),
    "flood": Measurement(_module("flood", "--seconds", "8", "--pairs", "5"), 3, quiet=True),
    "subscribers": Measurement(_module("subscribers"), 6, quiet=True),
    "lossy_link": Measurement(_module("lossy_link", "--seconds", "12"), 16, quiet=True),
    "strangers": Measurement(_module("strangers"), 2),
    "growth": Measurement(_module("growth"), 4),
    "kills": Measurement(_module("kills"), 12),
    "fuzz_readers": Measurement(("-m", "pytest", "tests/fuzz/test_fuzz_readers.py", "--fuzz-seconds", "120"), 18),
    "fuzz_ports": Measurement(("-m", "pytest", "tests/fuzz/test_fuzz_ports.py", "--fuzz-seconds", "600"), 11),
    "soak": Measurement(_module("soak"), 61),
}
BY_DEFAULT = ("clock", "flood", "subscribers", "lossy_link", "strangers", "growth", "kills")


def main() -> int:
    names = ", ".join(f"{name}{'*' * each.quiet} ({each.minutes} min)" for name, each in MEASUREMENTS.items())
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=BY_DEFAULT, metavar="NAME", help=names)
    chosen = parser.parse_args().names
    if unknown := set(chosen) - set(MEASUREMENTS):
        parser.error(f"{min(unknown)} is not a measurement; there are {names}")
    failed = []
    for name in chosen:
        print(f"\n{time.strftime('%H:%M:%S')} {name}, load {os.getloadavg()[0]:.2f}", flush=True)
        if subprocess.run([sys.executable, *MEASUREMENTS[name].arguments], cwd=ROOT, check=False).returncode:
            failed.append(name)
    print(f"\nfailed: {', '.join(failed) or 'none'}")
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
