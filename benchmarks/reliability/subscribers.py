"""What one subscriber sees while another stops, reads slowly, or fifty more come; and what the server holds for them.

Quiet and crowded stretches take turns on one server with one watcher, so that whatever else this machine does disturbs
both alike. The delay is from the last frame a tick needed, as it was handed to the sender's socket, to its hands
received. A stopped subscriber is a process under SIGSTOP; its connection stays.
"""

import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager

import numpy as np
from live_server import serving

from manipnet_tools.bench.live import TimedSender

from .live import Watched, playing, watching
from .motion import frames, motion
from .process import usage
from .roles import start
from .row import Row, parser, report

RATE_HZ, SETTLE_S, LOOK_AHEAD_S = 120.0, 2.0, 0.1
P99_RATIO, HELD_MB = 1.1, 20.0
CROWD = 50
CASES: dict[str, Sequence[tuple[str, ...]]] = {
    "one that reads once a second": [("slow",)],
    "one that is stopped": [("crowd", "1")],
    f"{CROWD} more": [("crowd", str(CROWD))],
}


@contextmanager
def company(address: str, roles: Sequence[tuple[str, ...]], stopped: bool) -> Iterator[None]:
    """Other subscribers, of which all are stopped or none."""
    with ExitStack() as opened:
        for role, *more in roles:
            process = opened.enter_context(start(role, address, *more))
            opened.callback(process.kill)
            assert process.stdout is not None
            process.stdout.readline()
            if stopped:
                process.send_signal(signal.SIGSTOP)
        yield


def delays_s(watched: Watched, sent: Sequence[tuple[float, float]]) -> np.ndarray:
    """Seconds from the frame that completed a tick handed over, to the tick received."""
    times_s, handed_s = np.array(sent).T
    due = np.searchsorted(times_s, [m.t_capture + LOOK_AHEAD_S - 1e-6 for m in watched.messages])
    known = due < len(times_s)
    return np.array(watched.arrived_s)[known] - handed_s[due[known]]


def compare(case: str, seconds: float, pairs: int) -> Row:
    """Quiet and crowded stretches in turn."""
    performance = motion(RATE_HZ)
    meshes = [f"--mesh={name}={path}" for name, path in performance.meshes.items()]
    parts: dict[str, list[np.ndarray]] = {"quiet": [], "company": []}
    shown: list[bool] = []
    held: list[float] = []
    with serving(*meshes, "--look-ahead", str(LOOK_AHEAD_S)) as server, watching(server.addresses["hands"]) as watched:
        host, _, port = server.addresses["bodies"].removeprefix("tcp://").rpartition(":")
        sender = TimedSender(host, int(port))
        with playing(frames(performance, np.inf), sender):

            def stretch(what: str) -> None:
                time.sleep(SETTLE_S)
                part = _stretch(watched, seconds)
                parts[what].append(delays_s(part, list(sender.sent)))
                sequence = np.diff([message.seq for message in part.messages])
                shown.append(bool((sequence == 1).all()))
                held.append(usage(server.process.pid).own_mb)

            for _ in range(pairs):
                stretch("quiet")
                with company(server.addresses["hands"], CASES[case], "stopped" in case):
                    stretch("company")
    p99 = {what: float(np.percentile(np.concatenate(values), 99)) for what, values in parts.items()}
    ratio, low, high = _ratio(parts)
    grown = max(held) - held[0]
    print(case, p99, ratio, (low, high), held, file=sys.stderr, flush=True)
    return Row(
        f"{case}, {pairs} stretches of {seconds:g} s",
        f"the other's p99 within {100 * (P99_RATIO - 1):.0f} %, nothing lost, memory bounded",
        f"p99 {1e3 * p99['company']:.2f} ms, quiet {1e3 * p99['quiet']:.2f} ms: {ratio:.2f} times (95 %: {low:.2f} … "
        f"{high:.2f}); every message came: {all(shown)}; memory {grown:+.1f} MB at most",
        ratio < P99_RATIO and all(shown) and grown < HELD_MB,
        {"p99_s": {what: [float(np.percentile(v, 99)) for v in values] for what, values in parts.items()}}
        | {"p50_s": {what: [float(np.median(v)) for v in values] for what, values in parts.items()}, "own_mb": held},
    )


def _ratio(parts: dict[str, list[np.ndarray]]) -> tuple[float, float, float]:
    """Of the two p99, and its 95 % interval from drawing seconds anew."""
    rng = np.random.default_rng(1)
    blocks = {
        what: [b for values in of_what for b in np.array_split(values, max(len(values) // 60, 1))]
        for what, of_what in parts.items()
    }
    p99: Callable[[list[np.ndarray]], float] = lambda some: float(np.percentile(np.concatenate(some), 99))  # noqa: E731
    draws = [
        p99([blocks["company"][i] for i in rng.integers(0, len(blocks["company"]), len(blocks["company"]))])
        / p99([blocks["quiet"][i] for i in rng.integers(0, len(blocks["quiet"]), len(blocks["quiet"]))])
        for _ in range(500)
    ]
    low, high = np.percentile(draws, (2.5, 97.5))
    return p99(blocks["company"]) / p99(blocks["quiet"]), float(low), float(high)


def _stretch(watched: Watched, seconds: float) -> Watched:
    start_s = time.monotonic()
    time.sleep(seconds)
    return watched.since(start_s, start_s + seconds)


def main() -> None:
    options = parser(__doc__, 10.0)
    options.add_argument("--pairs", type=int, default=4, help="quiet and crowded stretches (default: %(default)s)")
    arguments = options.parse_args()
    report("subscribers", [compare(case, arguments.seconds, arguments.pairs) for case in CASES], arguments.out)


if __name__ == "__main__":
    main()
