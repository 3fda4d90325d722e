"""50,000 garbage datagrams a second at the OSC port from another address, while somebody performs.

Quiet and flooded stretches take turns on one server, so that whatever else this machine does disturbs both alike. The
published interval is between two hands messages of the server; every tick of the performance must come out live.
"""

import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from live_server import serving

from manipnet.tracking.tick import TICK_HZ

from .live import Watched, osc_sender, playing, watching
from .motion import frames, motion
from .row import Row, parser, report

RATE_HZ, FLOOD_HZ = 120.0, 50_000.0
SETTLE_S, P99_RATIO = 2.0, 2.0


@contextmanager
def flooding(address: str, rate_hz: float) -> Iterator[list[float]]:
    """The flood; after the block the list holds what it came to, datagrams a second."""
    command = [sys.executable, "-m", "benchmarks.reliability.sandstorm", address.removeprefix("udp://"), str(rate_hz)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parents[2]) as process:
        assert process.stdout is not None
        try:
            process.stdout.readline()
            reached_hz: list[float] = []
            yield reached_hz
        finally:
            process.kill()
            seconds, sent = (float(word) for word in process.stdout.read().splitlines()[-1].split())
            reached_hz.append(sent / seconds)


def stretches(seconds: float, pairs: int) -> tuple[dict[str, list[Watched]], list[float], dict]:
    """`pairs` of quiet and flooded stretches in turn, the rate of each flood, and the last `status`."""
    performance = motion(RATE_HZ)
    watched_by: dict[str, list[Watched]] = {"quiet": [], "flood": []}
    floods: list[float] = []
    total_s = 2.0 * pairs * (seconds + 2.0 * SETTLE_S) + SETTLE_S
    with (
        serving(*(f"--mesh={name}={path}" for name, path in performance.meshes.items())) as server,
        watching(server.addresses["hands"]) as watched,
        playing(frames(performance, total_s + 30.0), osc_sender(server.addresses["osc"])),
    ):
        time.sleep(SETTLE_S)
        for _ in range(pairs):
            watched_by["quiet"].append(_stretch(watched, seconds))
            with flooding(server.addresses["osc"], FLOOD_HZ) as reached_hz:
                time.sleep(SETTLE_S)
                watched_by["flood"].append(_stretch(watched, seconds))
            floods += reached_hz
            time.sleep(SETTLE_S)
        return watched_by, floods, server.ask({"op": "status"})


def newcomer(tries: int) -> list[float]:
    """Seconds from a new sender's first frame to the first frame of it that is accepted, in a flood that goes on."""
    performance, times = motion(RATE_HZ), []
    for _ in range(tries):
        with serving() as server, flooding(server.addresses["osc"], FLOOD_HZ):
            time.sleep(SETTLE_S)
            with playing(frames(performance, 60.0), osc_sender(server.addresses["osc"])):
                start_s = time.monotonic()
                while not server.ask({"op": "status"})["counters"].get("frames_in", {}).get("osc"):
                    time.sleep(0.002)
                times.append(time.monotonic() - start_s)
    return times


def _stretch(watched: Watched, seconds: float) -> Watched:
    start_s = time.monotonic()
    time.sleep(seconds)
    part = watched.since(start_s, start_s + seconds)
    states = Counter("/".join(hand.state for hand in message.hands.values()) for message in part.messages)
    print(f"{share(part):.3f} of ticks live, {dict(states)}, longest interval {part.intervals_s().max():.3f} s")
    return part


def main() -> None:
    options = parser(__doc__, 10.0)
    options.add_argument("--pairs", type=int, default=4, help="quiet and flooded stretches (default: %(default)s)")
    arguments = options.parse_args()
    watched, floods, status = stretches(arguments.seconds, arguments.pairs)
    intervals = {what: np.concatenate([w.intervals_s() for w in parts]) for what, parts in watched.items()}
    p50, p99 = ({what: np.percentile(values, p) for what, values in intervals.items()} for p in (50, 99))
    shown = [share(part) for part in watched["flood"]]
    ratio = p99["flood"] / p99["quiet"]
    times = newcomer(arguments.pairs)
    rows = [
        Row(
            f"flood of {np.mean(floods):.0f} datagrams/s, {arguments.pairs} stretches of {arguments.seconds:g} s",
            f"output complete, p99 interval < {P99_RATIO:g} times quiet",
            f"{100 * min(shown):.2f} % of ticks live; interval p50 {1e3 * p50['flood']:.1f} (quiet "
            f"{1e3 * p50['quiet']:.1f}), p99 {1e3 * p99['flood']:.1f} ms (quiet {1e3 * p99['quiet']:.1f}): "
            f"{ratio:.2f} times",
            min(shown) >= 1.0 and ratio < P99_RATIO,
            {"shown": shown, "floods_hz": floods, "ratio": ratio, "counters": status["counters"]}
            | {f"p99_{what}_s": [np.percentile(w.intervals_s(), 99) for w in parts] for what, parts in watched.items()},
        ),
        Row(
            f"a new sender in that flood, {len(times)} times",
            "gets in",
            f"after {1e3 * np.median(times):.0f} ms median, {1e3 * max(times):.0f} ms at most",
            None,
            {"seconds": times},
        ),
    ]
    report("flood", rows, arguments.out)


def share(watched: Watched) -> float:
    """Of the ticks between the first and the last message: those that came out, both hands live."""
    messages = watched.messages
    live = [m for m in messages if m.hands and all(hand.state == "live" for hand in m.hands.values())]
    expected = round((messages[-1].t_capture - messages[0].t_capture) * TICK_HZ) + 1
    return len({round(m.t_capture * TICK_HZ) for m in live}) / expected


if __name__ == "__main__":
    main()
