"""What half an hour cannot tell of memory in MB an hour: does anything stay behind of a tick, a client, a request?

The server's own tick loop for two actors, without sockets, as fast as it goes: how many blocks Python's allocator
holds. Then a real server that is visited again and again: its memory after each hundred of metrics read, subscribers,
requests.
"""

import gc
import sys
import time
import urllib.request
from collections.abc import Callable

import msgpack
import numpy as np
import zmq
from live_server import LiveServer, serving

from manipnet.synthesis.model.bundle import load_bundle
from manipnet.wire import TOPIC_BIN
from manipnet_tools.bench.harness import Rig
from manipnet_tools.bench.scenarios import demo

from .live import playing, zmq_sender
from .motion import frames, motion
from .process import usage
from .row import Row, parser, report

TICKS, ROUNDS, VISITS = 1_500, 8, 100
ASK_S = 0.006
"""Requests are held back beyond a rate no client has."""


def blocks() -> list[int]:
    """Blocks held after each round of ticks."""
    rig, held = Rig(load_bundle(), demo(), actors=2), []
    for _ in range(ROUNDS):
        for _ in range(TICKS):
            rig.tick()
        gc.collect()
        held.append(sys.getallocatedblocks())
    return held


def read_metrics(server: LiveServer) -> None:
    with urllib.request.urlopen(server.addresses["metrics"], timeout=10.0) as response:
        response.read()


def subscribe(server: LiveServer) -> None:
    with zmq.Context() as context, context.socket(zmq.SUB) as socket:
        socket.setsockopt(zmq.LINGER, 0)
        socket.subscribe(TOPIC_BIN)
        socket.connect(server.addresses["hands"])
        socket.poll(1_000)


def ask(server: LiveServer) -> None:
    with zmq.Context() as context, context.socket(zmq.REQ) as socket:
        socket.setsockopt(zmq.LINGER, 0)
        socket.connect(server.addresses["control"])
        socket.send(msgpack.packb({"op": "status"}) or b"")
        socket.poll(1_000)
    time.sleep(ASK_S)


def visited(visit: Callable[[LiveServer], None]) -> list[float]:
    """MB of its own before, and after each hundred visits to a server that performs."""
    performance = motion(120.0)
    meshes = [f"--mesh={name}={path}" for name, path in performance.meshes.items()]
    with serving(*meshes, "--metrics-port", "0") as server:
        with playing(frames(performance, np.inf), zmq_sender(server.addresses["bodies"])):
            time.sleep(5.0)
            held = [usage(server.process.pid).own_mb]
            for _ in range(4):
                for _ in range(VISITS):
                    visit(server)
                held.append(usage(server.process.pid).own_mb)
        return held


def main() -> None:
    arguments = parser(__doc__, 0.0).parse_args()
    held = blocks()
    per_tick = (held[-1] - held[1]) / (TICKS * (ROUNDS - 2))
    text = f"{held[1]} → {held[-1]} blocks over {TICKS * (ROUNDS - 2)} ticks: {per_tick:.4f} a tick"
    rows = [Row("tick loop, two actors", "none stays", text, abs(per_tick) < 0.01, {"blocks": held})]
    for what, visit in (("metrics read", read_metrics), ("subscribers", subscribe), ("status requests", ask)):
        own_mb = visited(visit)
        text = " → ".join(f"{value:.2f}" for value in own_mb) + " MB"
        rows.append(
            Row(f"{what}, {VISITS} at a time", "levels off", text, own_mb[-1] - own_mb[2] < 0.1, {"mb": own_mb})
        )
    report("growth", rows, arguments.out)


if __name__ == "__main__":
    main()
