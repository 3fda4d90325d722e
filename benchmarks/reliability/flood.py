"""What 50,000 garbage datagrams a second from another address at the OSC port do to a live session.

Quiet and flooded periods alternate on one server, so that other work on this machine disturbs both alike. The published
interval is the time between two hands messages of the server. Every tick of the motion must be published as live.
"""

import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from benchmarks.support import ROOT, serving
from benchmarks.traffic import Received, osc_sender, playing, receiving
from manipnet.tracking.tick import TICK_HZ

from .motion import frames, mesh_options, motion
from .row import Row, parser, report

RATE_HZ, FLOOD_HZ = 120.0, 50_000.0
SETTLE_S, P99_RATIO = 2.0, 2.0


@contextmanager
def flooding(address: str, rate_hz: float) -> Iterator[list[float]]:
    """Flood the address during the block; afterwards the list holds the rate reached, datagrams a second."""
    command = [
        sys.executable,
        "-m",
        "benchmarks.reliability.garbage_sender",
        address.removeprefix("udp://"),
        str(rate_hz),
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        assert process.stdout is not None
        try:
            process.stdout.readline()
            reached_hz: list[float] = []
            yield reached_hz
        finally:
            process.kill()
            seconds, sent = (float(word) for word in process.stdout.read().splitlines()[-1].split())
            reached_hz.append(sent / seconds)


def measure(seconds: float, pairs: int) -> tuple[dict[str, list[Received]], list[float], dict]:
    """Alternate quiet and flooded periods; returns their messages, the rate of each flood, and the last `status`."""
    scenario = motion(RATE_HZ)
    periods: dict[str, list[Received]] = {"quiet": [], "flood": []}
    floods: list[float] = []
    total_s = 2.0 * pairs * (seconds + 2.0 * SETTLE_S) + SETTLE_S
    with (
        serving(*mesh_options(scenario)) as server,
        receiving(server.addresses["hands"]) as received,
        playing(frames(scenario, total_s + 30.0), osc_sender(server.addresses["osc"])),
    ):
        time.sleep(SETTLE_S)
        for _ in range(pairs):
            periods["quiet"].append(_period(received, seconds))
            with flooding(server.addresses["osc"], FLOOD_HZ) as reached_hz:
                time.sleep(SETTLE_S)
                periods["flood"].append(_period(received, seconds))
            floods += reached_hz
            time.sleep(SETTLE_S)
        return periods, floods, server.ask({"op": "status"})


def newcomer(tries: int) -> list[float]:
    """Seconds from a new sender's first frame until the server accepts one of its frames, during a flood."""
    scenario, times = motion(RATE_HZ), []
    for _ in range(tries):
        with serving() as server, flooding(server.addresses["osc"], FLOOD_HZ):
            time.sleep(SETTLE_S)
            with playing(frames(scenario, 60.0), osc_sender(server.addresses["osc"])):
                start_s = time.monotonic()
                while not server.ask({"op": "status"})["counters"].get("frames_in", {}).get("osc"):
                    time.sleep(0.002)
                times.append(time.monotonic() - start_s)
    return times


def _period(received: Received, seconds: float) -> Received:
    part = received.next(seconds)
    states = Counter("/".join(hand.state for hand in message.hands.values()) for message in part.messages)
    print(f"{live_share(part):.3f} of ticks live, {dict(states)}, longest interval {part.intervals_s().max():.3f} s")
    return part


def main() -> None:
    options = parser(__doc__, 10.0)
    options.add_argument(
        "--pairs", type=int, default=4, help="number of quiet and of flooded periods (default: %(default)s)"
    )
    arguments = options.parse_args()
    periods, floods, status = measure(arguments.seconds, arguments.pairs)
    intervals = {what: np.concatenate([part.intervals_s() for part in parts]) for what, parts in periods.items()}
    p50, p99 = ({what: np.percentile(values, p) for what, values in intervals.items()} for p in (50, 99))
    live = [live_share(part) for part in periods["flood"]]
    ratio = p99["flood"] / p99["quiet"]
    times = newcomer(arguments.pairs)
    rows = [
        Row(
            f"flood of {np.mean(floods):.0f} datagrams/s, {arguments.pairs} periods of {arguments.seconds:g} s",
            f"output complete, p99 interval < {P99_RATIO:g} times quiet",
            f"{100 * min(live):.2f} % of ticks live; interval p50 {1e3 * p50['flood']:.1f} (quiet "
            f"{1e3 * p50['quiet']:.1f}), p99 {1e3 * p99['flood']:.1f} ms (quiet {1e3 * p99['quiet']:.1f}): "
            f"{ratio:.2f} times",
            min(live) >= 1.0 and ratio < P99_RATIO,
            {"live": live, "floods_hz": floods, "ratio": ratio, "counters": status["counters"]}
            | {
                f"p99_{what}_s": [np.percentile(part.intervals_s(), 99) for part in parts]
                for what, parts in periods.items()
            },
        ),
        Row(
            f"a new sender during that flood, {len(times)} times",
            "is accepted",
            f"after {1e3 * np.median(times):.0f} ms median, {1e3 * max(times):.0f} ms at most",
            None,
            {"seconds": times},
        ),
    ]
    report("flood", rows, arguments.out)


def live_share(received: Received) -> float:
    """The share of the ticks between the first and the last message that were published with live hands."""
    messages = received.messages
    live = [m for m in messages if m.hands and all(hand.state == "live" for hand in m.hands.values())]
    expected = round((messages[-1].t_capture - messages[0].t_capture) * TICK_HZ) + 1
    return len({round(m.t_capture * TICK_HZ) for m in live}) / expected


if __name__ == "__main__":
    main()
