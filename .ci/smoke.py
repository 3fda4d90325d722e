"""Install a wheel into a new environment, as a user would, and start the server: `python .ci/smoke.py dist/*.whl`."""

import os
import subprocess
import sys
import tempfile
import threading
import venv
from pathlib import Path

FREE_PORTS = [f"--{name}-port=0" for name in ("input", "control", "osc", "page", "web")] + ["--port=0"]
START_S = 300.0
LICENCES = ("License-Expression: Apache-2.0 AND CC-BY-NC-4.0", "License-File: LICENSE", "License-File: models/LICENSE")
METADATA = "from importlib.metadata import distribution; print(distribution('manipnet-live').read_text('METADATA'))"


def main(wheel: str) -> None:
    """Install without extras, look at the metadata, run the commands, and wait until the demo is ready."""
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
        start_demo([str(programs / "manipnet-serve"), "--demo", *FREE_PORTS], folder)


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
