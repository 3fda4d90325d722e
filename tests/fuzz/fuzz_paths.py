"""Makes what writes good inputs for the tests importable when a fuzzer runs outside pytest."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "support"))
