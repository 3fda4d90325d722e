"""Makes the packet writers of the stream tests importable, also when a fuzzer runs outside pytest."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "streams"))
