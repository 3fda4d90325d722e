"""The measurements of benchmarks/ follow the code: each can be imported, and README.md lists each."""

import subprocess
import sys

from checkout import ROOT

MODULES = sorted(
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for path in (ROOT / "benchmarks").rglob("*.py")
    if path.name not in ("__init__.py", "straightforward.py")  # needs PyTorch
)


def test_every_measurement_can_be_imported():
    subprocess.run([sys.executable, "-c", f"import {', '.join(MODULES)}"], cwd=ROOT, check=True, timeout=120)


def test_the_readme_lists_every_measurement():
    text = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
    for path in (ROOT / "benchmarks").rglob("*.py"):
        if '__name__ == "__main__"' in path.read_text(encoding="utf-8"):
            module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            assert module in text or path.relative_to(ROOT).as_posix() in text, path
