"""What a server needs and takes of the memory of its machine."""

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits the address space reliably")
def test_a_small_address_space_is_refused_in_one_sentence(tiny_bundle: Path) -> None:
    command = [sys.executable, "-m", "manipnet.cli", "--model", str(tiny_bundle), "--mesh", "Box=cube"]
    limited = ["sh", "-c", 'ulimit -v 900000 && exec "$0" "$@"', *command]
    ended = subprocess.run(limited, capture_output=True, text=True, timeout=60.0, check=False)
    assert ended.returncode == 1
    assert ended.stdout == ""
    assert ended.stderr.startswith("manipnet-serve: the address space of this process is limited to 0.9 GB")
    assert "ulimit -v unlimited" in ended.stderr
    assert len(ended.stderr.splitlines()) == 1


ALLOCATE = """
import sys, threading
from manipnet.runtime.memory import share_arenas
if sys.argv[1] == "shared":
    share_arenas()
inside, leave = threading.Barrier(33), threading.Event()
def allocate():
    kept = [bytes(1000) for _ in range(1000)]
    inside.wait()
    leave.wait()
threads = [threading.Thread(target=allocate) for _ in range(32)]
for thread in threads:
    thread.start()
inside.wait()
size = next(line for line in open("/proc/self/status") if line.startswith("VmData"))
leave.set()
print(size.split()[1])
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only glibc has arenas")
def test_threads_share_the_arenas_of_the_allocator() -> None:
    shared, own = (
        int(subprocess.run([sys.executable, "-c", ALLOCATE, how], capture_output=True, text=True, check=True).stdout)
        for how in ("shared", "own")
    )
    assert shared < own, "kB of address space"


WITHOUT = """
import sys
from manipnet.runtime.memory import leave_out_linear_algebra
leave_out_linear_algebra()
import numpy as np
from manipnet.actors.soundness import are_sound
assert are_sound(np.ones(4), np.array([[0, 1, 2, 3]]), 1.0, 3.0)
assert "scipy.linalg" not in sys.modules, "a kernel has loaded it"
import scipy.linalg
assert scipy.linalg.det(np.eye(2)) == 1.0, "it can be loaded later"
"""


def test_a_server_does_without_scipys_linear_algebra() -> None:
    subprocess.run([sys.executable, "-W", "error", "-c", WITHOUT], check=True, timeout=120.0)
