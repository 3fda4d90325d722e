"""Install the wheels as a user and the Dockerfile do: `python .ci/smoke.py WHEEL FULL_WIDTH_WHEEL`.

The demo is started with the command of the container.
"""

import os
import subprocess
import sys
import tempfile
import threading
import venv
from pathlib import Path

import container

FREE_PORTS = [f"--{name}-port=0" for name in ("input", "control", "osc", "page", "web")] + ["--port=0"]
START_S = 300.0
LARGEST_WHEEL_MB = 15
LICENCES = ("License-Expression: Apache-2.0 AND CC-BY-NC-4.0", "License-File: LICENSE", "License-File: models/LICENSE")
COMPILED = "from manipnet.jit import cached; from manipnet.runtime.precompile import SENSING; print(cached(SENSING))"
METADATA = "from importlib.metadata import distribution; print(distribution('manipnet-live').read_text('METADATA'))"


def main(wheel: str, full_width_wheel: str) -> None:
    """Install without extras, look at the metadata, run the commands, start the demo, add the large models."""
    size_mb = Path(wheel).stat().st_size / 1e6
    assert size_mb <= LARGEST_WHEEL_MB, f"the wheel has {size_mb:.1f} MB; at most {LARGEST_WHEEL_MB} are allowed"
    with tempfile.TemporaryDirectory() as folder:
        venv.create(folder, with_pip=True)
        programs = Path(folder) / ("Scripts" if os.name == "nt" else "bin")
        python = str(programs / "python")
        constraints = Path(__file__).parents[1] / "constraints.txt"
        subprocess.run([python, "-m", "pip", "install", "-q", "-c", str(constraints), wheel], check=True)
        metadata = subprocess.run([python, "-c", METADATA], stdout=subprocess.PIPE, text=True, check=True).stdout
        missing = [line for line in LICENCES if line not in metadata.splitlines()]
        assert not missing, f"the wheel's metadata lacks {missing}"
        for arguments in (["--help"], ["doctor", "--help"], ["replay", "--help"]):
            subprocess.run([programs / "manipnet", *arguments], stdout=subprocess.DEVNULL, check=True, cwd=folder)
        found = subprocess.run([python, "-c", COMPILED], stdout=subprocess.PIPE, text=True, check=True).stdout
        assert found.strip() == "True", "the wheel brings no kernels for this computer, or they are not used"
        program, *arguments = container.command()
        start_demo([str(programs / program), *arguments, *FREE_PORTS], folder)
        add_full_width(programs, full_width_wheel)


def add_full_width(programs: Path, wheel: str) -> None:
    """Ask for a full-width model before and after its package is installed."""
    command = [programs / "manipnet-serve", "--model", "manipnet-full-int8"]
    refusal = subprocess.run(command, stderr=subprocess.PIPE, text=True, check=False, timeout=START_S).stderr
    assert "manipnet-live-full-width, which is not installed" in refusal, refusal
    subprocess.run([programs / "python", "-m", "pip", "install", "-q", wheel], check=True)
    version = subprocess.run([programs / "manipnet", "--version"], stdout=subprocess.PIPE, text=True, check=True).stdout
    assert "manipnet-full-int8" in version, version
    assert "manipnet-open: Apache-2.0" in version, version


def start_demo(command: list[str], folder: str) -> None:
    """Start the server, read its `ready` line and a status line, and stop it."""
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=folder) as server:
        give_up = threading.Timer(START_S, server.kill)
        give_up.start()
        try:
            assert server.stdout is not None
            ready, status = server.stdout.readline(), server.stdout.readline()
        finally:
            give_up.cancel()
            server.terminate()
        print(ready, status, sep="", flush=True)
        assert ready.startswith("ready hands tcp://"), "the server did not become ready"
        assert server.wait(60.0) == 0 or os.name == "nt", "the server did not end cleanly"


if __name__ == "__main__":
    main(*sys.argv[1:])
