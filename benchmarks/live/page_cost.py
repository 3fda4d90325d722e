"""What an open page costs the hands: the server of the demo without and with a browser at its page, alternately.

It needs Chromium and Linux. The browser draws in software here, which a graphics card does elsewhere; therefore it only
gets the processor time that the server, at its usual priority, leaves (`chrt --idle`).
"""

import argparse
import os
import shutil
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks.support import LiveServer, Subscriber, browsing, serving
from manipnet.wire import HandsMessage

TURNS = 3
SETTLE_S = 5.0


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seconds", nargs="?", type=float, default=20.0, help="of each turn (default: %(default)g)")
    seconds = parser.parse_args().seconds
    chromium = shutil.which("chromium")
    if chromium is None:
        sys.exit("this measurement needs Chromium: apt-get install chromium")
    without: list[HandsMessage] = []
    beside: list[HandsMessage] = []
    with serving("--demo") as server, tempfile.TemporaryDirectory() as folder:
        wrapper = Path(folder) / "chromium"
        wrapper.write_text(f'#!/bin/sh\nexec chrt --idle 0 {chromium} "$@"\n')
        wrapper.chmod(0o755)
        for turn in range(TURNS):
            without += listen(server, seconds)
            with browsing(str(wrapper), server.addresses["page"], Path(folder) / f"profile{turn}") as page:
                page.wait_for("document.body.innerText.includes('hands/s')", 240.0)
                beside += listen(server, seconds)
        frames = server.ask({"op": "status"})["counters"]["page_frames"]
    rows = {"without": figures(without), "with a page": figures(beside)}
    rows["ratio"] = rows["with a page"] / rows["without"]
    print(
        f"{TURNS} turns of {seconds:g} s each; load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores; page: {frames}"
    )
    print("| | tick p50, ms | p99 | interval p50, ms | p99 |\n|---|--:|--:|--:|--:|")
    for name, row in rows.items():
        print(f"| {name} | " + " | ".join(f"{value:.2f}" for value in row) + " |")


def listen(server: LiveServer, seconds: float) -> list[HandsMessage]:
    """The messages published during `seconds`, after a pause in which the load settles."""
    time.sleep(SETTLE_S)
    subscriber = Subscriber(server.addresses["hands"])
    messages = [subscriber.next()]
    while messages[-1].t_publish < messages[0].t_publish + seconds:
        messages.append(subscriber.next())
    subscriber.close()
    return messages


def figures(messages: list[HandsMessage]) -> np.ndarray:
    """Median and 99th percentile of a tick's work and of the time between two messages, in milliseconds `(4,)`."""
    work_ms = [m.latency_ms.sense + m.latency_ms.infer + m.latency_ms.ik for m in messages]
    pairs = pairwise(messages)
    apart_ms = [1e3 * (b.t_publish - a.t_publish) for a, b in pairs if b.seq == a.seq + 1]
    return np.concatenate([np.percentile(values, [50, 99]) for values in (work_ms, apart_ms)])


if __name__ == "__main__":
    main()
