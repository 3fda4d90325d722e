"""Makes the Python client and the helpers beside this file importable."""

import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
HERE = Path(__file__).parent
sys.path[:0] = [
    str(HERE),
    str(ROOT / "clients"),
    str(ROOT / "clients" / "python"),
    str(ROOT / "tests" / "vectors"),
]
