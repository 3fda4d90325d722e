"""Whether memory, descriptors or threads grow during an hour in which everything is used.

The server plays its demo. A subscriber receives the hands, a browser shows the page, and clients send requests: every
ten seconds `status`, `objects`, `look_ahead` and `select_object`; every minute another subscriber connects for a second
and the metrics are read; every five minutes a recording of 30 s is made. Memory is the private memory (USS) of the
server and of its page's process, sampled every ten seconds. A line is fitted to each after a warm-up. The uncertainty
of the line comes from averages over a minute, because neighbouring samples are correlated.

It needs Chromium and Linux. The browser draws in software here, which a graphics card does elsewhere, so it runs at a
lower priority (`nice -n 15`).
"""

import argparse
import itertools
import os
import shutil
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
import zmq

from benchmarks.support import LiveServer, browsing, serving
from manipnet.wire import TOPIC_BIN, TOPIC_MSGPACK, HandsMessage, decode_msgpack

from .process import Usage, usage_of, usage_of_children
from .row import Row, parser, report

SAMPLE_S, VISIT_S, RECORD_S, RECORDED_S, BLOCK_S = 10.0, 60.0, 300.0, 30.0, 60.0
OBJECTS = ("cube", "mug", "hammer", "sphere")
GAP_S = 0.05
"""A gap between two messages counts from here on: three ticks."""
SLOPE_MB_H = 1.0
BROWSER_S = 240.0


@dataclass
class Heard:
    """What a subscriber received: the messages, those that were missing, and the gaps between their publications."""

    messages: int = 0
    missing: int = 0
    gaps: int = 0
    largest_gap_s: float = 0.0
    _newest: HandsMessage | None = field(default=None, repr=False)

    def add(self, message: HandsMessage) -> None:
        """Count one message."""
        if self._newest is not None:
            gap_s = message.t_publish - self._newest.t_publish
            self.missing += message.seq - self._newest.seq - 1
            self.gaps += gap_s > GAP_S
            self.largest_gap_s = max(self.largest_gap_s, gap_s)
        self.messages += 1
        self._newest = message


@dataclass(frozen=True)
class Sample:
    """The usage of the server and of each of its children at a time, with the load of the machine."""

    at_s: float
    server: Usage
    children: dict[int, Usage]
    load: float


def soak(seconds: float, chromium: str) -> tuple[list[Sample], dict, Heard]:
    """The samples, the server's last `status`, and what the subscriber heard."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        wrapper = folder / "chromium"
        wrapper.write_text(f'#!/bin/sh\nexec chrt --other 0 nice -n 15 {chromium} "$@"\n')
        wrapper.chmod(0o755)
        options = ("--demo", "--metrics-port", "0", "--takes", str(folder / "takes"))
        with serving(*options) as server, browsing(str(wrapper), server.addresses["page"], folder / "browser") as page:
            page.wait_for("document.body.innerText.includes('hands/s')", BROWSER_S)
            with hearing(server.addresses["hands"]) as heard:
                samples = list(_sampled(server, seconds))
            if not page.evaluate("document.body.innerText.includes('hands/s')"):
                sys.exit("the page shows nothing any more")
            return samples, _status(server), heard


def _sampled(server: LiveServer, seconds: float) -> Iterator[Sample]:
    start_s = time.monotonic()
    objects = itertools.cycle(OBJECTS)
    for k in range(round(seconds / SAMPLE_S) + 1):
        time.sleep(max(start_s + k * SAMPLE_S - time.monotonic(), 0.0))
        pid = server.process.pid
        sample = Sample(time.monotonic() - start_s, usage_of(pid), dict(usage_of_children(pid)), os.getloadavg()[0])
        print(
            f"{sample.at_s:7.1f} s, load {sample.load:.1f}, server {sample.server}, "
            + ", ".join(f"child {child} {used}" for child, used in sample.children.items()),
            file=sys.stderr,
            flush=True,
        )
        yield sample
        server.ask({"op": "status"})
        server.ask({"op": "objects"})
        server.ask({"op": "look_ahead", "seconds": (0.5, 0.3)[k % 2]})
        server.ask({"op": "select_object", "body": "cube", "object": next(objects)})
        if k * SAMPLE_S % VISIT_S == VISIT_S / 2:
            _visit(server)
        match k * SAMPLE_S % RECORD_S:
            case at_s if at_s == RECORD_S / 2:
                server.ask({"op": "record"})
            case at_s if at_s == RECORD_S / 2 + RECORDED_S:
                server.ask({"op": "stop_recording"})


def _status(server: LiveServer) -> dict:
    """The server's status; on a very busy machine it takes more than one request."""
    while "counters" not in (status := server.ask({"op": "status"})):
        print(status, file=sys.stderr)
    return status


def _visit(server: LiveServer) -> None:
    """Connect a client for a second, and read the metrics."""
    with zmq.Context() as context, context.socket(zmq.SUB) as socket:
        socket.setsockopt(zmq.LINGER, 0)
        socket.subscribe(TOPIC_BIN)
        socket.connect(server.addresses["hands"])
        end_s = time.monotonic() + 1.0
        while (left_s := end_s - time.monotonic()) > 0.0:
            if socket.poll(int(1e3 * left_s) + 1):
                socket.recv()
    with urllib.request.urlopen(server.addresses["metrics"], timeout=10.0) as response:
        response.read()


@contextmanager
def hearing(address: str) -> Iterator[Heard]:
    """Subscribe to the hands on a thread until the end of the block."""
    heard, stopping = Heard(), threading.Event()

    def run() -> None:
        with zmq.Context() as context, context.socket(zmq.SUB) as socket:
            socket.setsockopt(zmq.LINGER, 0)
            socket.subscribe(TOPIC_MSGPACK)
            socket.connect(address)
            while not stopping.is_set():
                if socket.poll(100):
                    heard.add(decode_msgpack(socket.recv()[len(TOPIC_MSGPACK) :]))

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield heard
    finally:
        stopping.set()
        thread.join()


def slope_mb_h(points: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Growth in MB per hour of `(time in s, MB)`, and twice its standard error from the means of blocks.

    Both are NaN if there are fewer than four blocks.
    """
    blocks: dict[int, list[tuple[float, float]]] = {}
    for at_s, own_mb in points:
        blocks.setdefault(int(at_s // BLOCK_S), []).append((at_s / 3600.0, own_mb))
    if len(blocks) < 4:
        return np.nan, np.nan
    hours, own_mb = np.array([np.mean(block, axis=0) for block in blocks.values()]).T
    (slope, _), covariance = np.polyfit(hours, own_mb, 1, cov=True)
    return float(slope), 2.0 * float(np.sqrt(covariance[0, 0]))


def rows(samples: Sequence[Sample], status: dict, heard: Heard, warm_up_s: float) -> Iterator[Row]:
    """One row for the server, one for the page's process, one for all that lasted, and one for the hands."""
    settled = [sample for sample in samples if sample.at_s >= warm_up_s]
    lasting = set.intersection(*(set(sample.children) for sample in settled))
    series = {"server": [(sample.at_s, sample.server) for sample in settled]}
    page = max(lasting, key=lambda pid: settled[-1].children[pid].own_mb)  # the other one tracks semaphores
    series["page"] = [(sample.at_s, sample.children[page]) for sample in settled]
    series["together"] = [
        (sample.at_s, sum((sample.children[pid] for pid in lasting), sample.server)) for sample in settled
    ]
    for name, used in series.items():
        slope, error = slope_mb_h([(at_s, one.own_mb) for at_s, one in used])
        (begin_s, first), (end_s, last) = used[0], used[-1]
        descriptors, threads = (
            (min(values), max(values))
            for values in zip(*((one.descriptors, one.threads) for _, one in used), strict=True)
        )
        share = (last.cpu_s - first.cpu_s) / (end_s - begin_s)
        yield Row(
            f"{name}: from {begin_s / 60:.0f} to {end_s / 60:.0f} min",
            f"< {SLOPE_MB_H:g} MB/h",
            f"{slope:+.2f} ± {error:.2f} MB/h ({first.own_mb:.1f} → {last.own_mb:.1f} MB), descriptors "
            f"{descriptors[0]} to {descriptors[1]}, threads {threads[0]} to {threads[1]}, {share:.0%} of a core",
            slope < SLOPE_MB_H,
            {"slope_mb_h": slope, "two_sigma": error},
        )
    load = [sample.load for sample in samples]
    seconds = samples[-1].at_s - samples[0].at_s
    yield Row(
        "hands",
        "60 a second",
        f"{heard.messages / seconds:.2f} messages a second, {heard.missing} missing, {heard.gaps} gaps above "
        f"{1e3 * GAP_S:g} ms (largest {1e3 * heard.largest_gap_s:.0f} ms); skipped ticks "
        f"{status['counters'].get('ticks_skipped', {})}; load {min(load):.1f} to {max(load):.1f}, "
        f"mean {np.mean(load):.1f}",
        None,
        {"status": status, "samples": [asdict(sample) for sample in samples]},
    )


def main() -> None:
    options = parser(__doc__, 3600.0)
    options.formatter_class = argparse.RawDescriptionHelpFormatter
    options.add_argument(
        "--warm-up", type=float, default=600.0, help="seconds that are not fitted (default: %(default)g)"
    )
    arguments = options.parse_args()
    chromium = shutil.which("chromium")
    if chromium is None:
        sys.exit("this measurement needs Chromium: apt-get install chromium")
    samples, status, heard = soak(arguments.seconds, chromium)
    report("soak", list(rows(samples, status, heard, arguments.warm_up)), arguments.out)


if __name__ == "__main__":
    main()
