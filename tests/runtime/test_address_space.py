"""A server that cannot have the address space that it needs says so at its start."""

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits the address space reliably")
def test_a_small_address_space_is_refused_in_one_sentence(tiny_bundle: Path) -> None:
    command = [sys.executable, "-m", "manipnet.cli", "--model", str(tiny_bundle), "--mesh", "Box=cube"]
    limited = ["sh", "-c", 'ulimit -v 1500000 && exec "$0" "$@"', *command]
    ended = subprocess.run(limited, capture_output=True, text=True, timeout=60.0, check=False)
    assert ended.returncode == 1
    assert ended.stdout == ""
    assert ended.stderr.startswith("manipnet-serve: the address space of this process is limited to 1.5 GB")
    assert "ulimit -v unlimited" in ended.stderr
    assert len(ended.stderr.splitlines()) == 1
