"""Whether memory, descriptors or threads grow during half an hour with two actors at 240 Hz.

Meanwhile a client connects every minute for a second, `status` is requested every ten seconds and the metrics are read
every minute. The memory is the private memory of the server's processes (USS), sampled every five seconds. A line is
fitted to it after a warm-up. The uncertainty of the line comes from averages over a minute, because neighbouring
samples are correlated.
"""

import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import zmq

from benchmarks.support import LiveServer, serving
from benchmarks.traffic import playing, zmq_sender
from manipnet.wire import TOPIC_BIN, TOPIC_MSGPACK

from .motion import frames, motion, rig_file
from .process import Usage, usage
from .row import Row, parser, report

RATE_HZ, ACTORS = 240.0, 2
SAMPLE_S, ASK_S, VISIT_S, BLOCK_S = 5.0, 10.0, 60.0, 60.0
SLOPE_MB_H = 1.0


def soak(seconds: float) -> tuple[list[tuple[float, Usage]], dict, list[int]]:
    """Samples with their times, the server's last `status`, and the number of messages of each subscriber."""
    scenario = motion(RATE_HZ)
    with tempfile.TemporaryDirectory() as folder:
        rig = rig_file(scenario, ACTORS, Path(folder))
        with serving("--rig", str(rig), "--metrics-port", "0") as server:
            received = [0, 0]
            stopping = threading.Event()
            threads = [
                threading.Thread(target=_count, args=(server.addresses["hands"], topic, received, i, stopping))
                for i, topic in enumerate((TOPIC_MSGPACK, TOPIC_BIN))
            ]
            for thread in threads:
                thread.start()
            with playing(frames(scenario, np.inf, ACTORS), zmq_sender(server.addresses["bodies"])):
                samples = _sample(server, seconds)
                status = _status(server)
            stopping.set()
            for thread in threads:
                thread.join()
            return samples, status, received


def _sample(server: LiveServer, seconds: float) -> list[tuple[float, Usage]]:
    start_s, samples = time.monotonic(), []
    for k in range(round(seconds / SAMPLE_S) + 1):
        time.sleep(max(start_s + k * SAMPLE_S - time.monotonic(), 0.0))
        samples.append((time.monotonic() - start_s, usage(server.process.pid)))
        print(f"{samples[-1][0]:7.1f} s {samples[-1][1]}", file=sys.stderr, flush=True)
        if k * SAMPLE_S % ASK_S == 0:
            server.ask({"op": "status"})
        if k * SAMPLE_S % VISIT_S == VISIT_S / 2:
            _visit(server)
    return samples


def _status(server: LiveServer) -> dict:
    """The server's status; on a very busy machine it takes more than one request."""
    while "counters" not in (status := server.ask({"op": "status"})):
        print(status, file=sys.stderr)
    return status


def _visit(server: LiveServer) -> None:
    """Connect a client for a second, and read the metrics."""
    stopping, seen = threading.Event(), [0]
    thread = threading.Thread(target=_count, args=(server.addresses["hands"], TOPIC_BIN, seen, 0, stopping))
    thread.start()
    stopping.wait(1.0)
    stopping.set()
    thread.join()
    with urllib.request.urlopen(server.addresses["metrics"], timeout=10.0) as response:
        response.read()


def _count(address: str, topic: bytes, counts: list[int], index: int, stopping: threading.Event) -> None:
    with zmq.Context() as context, context.socket(zmq.SUB) as socket:
        socket.subscribe(topic)
        socket.connect(address)
        while not stopping.is_set():
            if socket.poll(100):
                socket.recv()
                counts[index] += 1


def slope_mb_h(samples: Sequence[tuple[float, Usage]]) -> tuple[float, float]:
    """Growth of private memory in MB per hour, and twice its standard error from the means of blocks.

    Both are NaN if there are fewer than four blocks.
    """
    blocks: dict[int, list[tuple[float, float]]] = {}
    for at_s, used in samples:
        blocks.setdefault(int(at_s // BLOCK_S), []).append((at_s / 3600.0, used.own_mb))
    if len(blocks) < 4:
        return np.nan, np.nan
    hours, own_mb = np.array([np.mean(block, axis=0) for block in blocks.values()]).T
    (slope, _), covariance = np.polyfit(hours, own_mb, 1, cov=True)
    return float(slope), 2.0 * float(np.sqrt(covariance[0, 0]))


def main() -> None:
    options = parser(__doc__, 1800.0)
    options.add_argument(
        "--warm-up", type=float, default=300.0, help="seconds that are not fitted (default: %(default)g)"
    )
    arguments = options.parse_args()
    samples, status, received = soak(arguments.seconds)
    settled = [(at_s, used) for at_s, used in samples if at_s >= arguments.warm_up]
    slope, error = slope_mb_h(settled)
    first, last = settled[0][1], settled[-1][1]
    flat = {
        what: sorted({getattr(used, what) for _, used in settled}) for what in ("descriptors", "threads", "processes")
    }
    measured = (
        f"{slope:+.2f} ± {error:.2f} MB/h (private {first.own_mb:.1f} → {last.own_mb:.1f} MB), "
        f"descriptors {flat['descriptors']}, threads {flat['threads']}; skipped ticks "
        f"{status['counters'].get('ticks_skipped', {})}, dropped {status['counters'].get('frames_dropped', {})}"
    )
    met = slope < SLOPE_MB_H and all(len(values) <= 2 for values in flat.values())
    row = Row(
        f"soak: {arguments.seconds / 60:g} min at {RATE_HZ:g} Hz, {ACTORS} actors",
        f"< {SLOPE_MB_H:g} MB/h, descriptors and threads flat",
        measured,
        met,
        {
            "slope_mb_h": slope,
            "two_sigma": error,
            "status": status,
            "received": received,
            "samples": [
                (at_s, used.own_mb, used.resident_mb, used.descriptors, used.threads) for at_s, used in samples
            ],
        }
        | flat,
    )
    report("soak", [row], arguments.out)


if __name__ == "__main__":
    main()
