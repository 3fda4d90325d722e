"""Makes what writes good inputs for the tests importable, also when a fuzzer runs outside pytest."""

import sys
from pathlib import Path

sys.path += [str(Path(__file__).parents[1] / "streams"), str(Path(__file__).parents[1])]
