"""Whether a tick, a client or a request leaves memory behind, more precisely than half an hour of `soak` can show.

First the server's tick loop runs for two actors, without sockets and as fast as possible, and the blocks that Python's
allocator holds are counted. Then a real server receives hundreds of metrics readers, subscribers and requests, and its
memory is measured after each hundred.
"""

import gc
import sys
import time
import urllib.request
from collections.abc import Callable

import numpy as np
import zmq

from benchmarks.support import LiveServer, serving
from benchmarks.traffic import playing, zmq_sender
from manipnet.synthesis.model.bundle import load_bundle
from manipnet.wire import TOPIC_BIN
from manipnet_tools.bench.harness import TickRunner
from manipnet_tools.bench.scenarios import demo

from .motion import frames, mesh_options, motion
from .process import usage
from .row import Row, parser, report

TICKS, ROUNDS, VISITS = 1_500, 8, 100
ASK_S = 0.006
"""The server delays requests above a rate that no client has."""


def blocks() -> list[int]:
    """The number of allocated blocks after each round of ticks."""
    runner, held = TickRunner(load_bundle(), demo(), actors=2), []
    for _ in range(ROUNDS):
        for _ in range(TICKS):
            runner.tick()
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
    server.ask({"op": "status"})
    time.sleep(ASK_S)


def visited(visit: Callable[[LiveServer], None]) -> list[float]:
    """Private memory in MB of a server with a live session, before and after each hundred visits."""
    scenario = motion(120.0)
    with serving(*mesh_options(scenario), "--metrics-port", "0") as server:
        with playing(frames(scenario, np.inf), zmq_sender(server.addresses["bodies"])):
            time.sleep(5.0)
            held = [usage(server.process.pid).own_mb]
            for _ in range(4):
                for _ in range(VISITS):
                    visit(server)
                held.append(usage(server.process.pid).own_mb)
        return held


def main() -> None:
    arguments = parser(__doc__, None).parse_args()
    held = blocks()
    per_tick = (held[-1] - held[1]) / (TICKS * (ROUNDS - 2))
    text = f"{held[1]} → {held[-1]} blocks over {TICKS * (ROUNDS - 2)} ticks: {per_tick:.4f} per tick"
    rows = [Row("tick loop, two actors", "no growth", text, abs(per_tick) < 0.01, {"blocks": held})]
    for what, visit in (("metrics read", read_metrics), ("subscribers", subscribe), ("status requests", ask)):
        own_mb = visited(visit)
        text = " → ".join(f"{value:.2f}" for value in own_mb) + " MB"
        rows.append(
            Row(f"{what}, {VISITS} at a time", "levels off", text, own_mb[-1] - own_mb[2] < 0.1, {"mb": own_mb})
        )
    report("growth", rows, arguments.out)


if __name__ == "__main__":
    main()
