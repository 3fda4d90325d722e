"""Measurements of how the server stands a bad day: `python -m benchmarks.reliability.NAME`, from the top of the
checkout.

Each starts real server processes on free loopback ports, stops by itself, prints its figures and writes them as JSON.
`docs/reliability.md` holds the results. They measure; the tests of the same matters assert nothing about time.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "support"))
