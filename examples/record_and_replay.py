"""Record and replay: let the server record three seconds, then play the recording back into it.

    python -m pip install ./clients/python
    manipnet-serve --mesh Box=cube
    python examples/record_and_replay.py [tcp://127.0.0.1:5557 [tcp://127.0.0.1:5556]]

The server writes the recording into its folder of takes. `manipnet synthesize` and `manipnet export` read it as well.
"""

import itertools
import subprocess
import sys
from pathlib import Path

import zmq
from manipnet_client import ControlClient
from send_bodies import RATE_HZ, bodies, frame_times

SECONDS = 3.0


def main(control: str = "tcp://127.0.0.1:5557", bodies_in: str = "tcp://127.0.0.1:5556") -> None:
    """Record what this program sends, then replay it."""
    server = ControlClient(control)
    server.ask("record")
    perform(bodies_in)
    take = server.ask("stop_recording")
    file = Path(server.ask("recordings")["folder"]) / take["name"]
    print(f"{file}: {take['bodies']} frames of bodies, {take['hands']} hands messages", flush=True)
    subprocess.run([sys.executable, "-m", "manipnet_tools.cli", "replay", str(file), "--to", bodies_in], check=True)
    print("replayed", flush=True)


def perform(bodies_in: str) -> None:
    """Send bodies for a while, as a tracker would."""
    with zmq.Context() as context, context.socket(zmq.PUB) as socket:
        socket.connect(bodies_in)
        for t_s in itertools.islice(frame_times(), int(SECONDS * RATE_HZ)):
            socket.send_json({"t": t_s, "bodies": bodies(t_s)})


if __name__ == "__main__":
    main(*sys.argv[1:])
