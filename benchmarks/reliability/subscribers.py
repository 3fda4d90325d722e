"""What one subscriber notices while another stops, reads slowly, or fifty more connect, and the memory they cost.

Quiet and crowded periods alternate on one server with one measured subscriber, so that other work on this machine
disturbs both alike. The delay counts from the moment at which the last frame that a tick needs is passed to the
sender's socket, until its hands arrive. A stopped subscriber is a process under SIGSTOP, whose connection stays open.
"""

import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

import numpy as np

from benchmarks.support import serving
from benchmarks.traffic import Received, playing, receiving
from manipnet_tools.bench.live import TimedSender

from .motion import frames, mesh_options, motion
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
    """Run other subscribers during the block; if `stopped`, all of them are."""
    with ExitStack() as opened:
        for role, *more in roles:
            process = opened.enter_context(start(role, address, *more))
            opened.callback(process.kill)
            assert process.stdout is not None
            process.stdout.readline()
            if stopped:
                process.send_signal(signal.SIGSTOP)
        yield


def delays_s(received: Received, sent: Sequence[tuple[float, float]]) -> np.ndarray:
    """Seconds from sending the frame that completed a tick until its hands arrived, for each message."""
    times_s, handed_s = np.array(sent).T
    due = np.searchsorted(times_s, [m.t_capture + LOOK_AHEAD_S - 1e-6 for m in received.messages])
    known = due < len(times_s)
    return np.array(received.arrived_s)[known] - handed_s[due[known]]


def compare(case: str, seconds: float, pairs: int) -> Row:
    """Alternate quiet and crowded periods."""
    scenario = motion(RATE_HZ)
    parts: dict[str, list[np.ndarray]] = {"quiet": [], "company": []}
    complete: list[bool] = []
    held_mb: list[float] = []
    options = (*mesh_options(scenario), "--look-ahead", str(LOOK_AHEAD_S))
    with serving(*options) as server, receiving(server.addresses["hands"]) as received:
        host, _, port = server.addresses["bodies"].removeprefix("tcp://").rpartition(":")
        sender = TimedSender(host, int(port))
        with playing(frames(scenario, np.inf), sender):

            def measure(what: str) -> None:
                time.sleep(SETTLE_S)
                part = received.next(seconds)
                parts[what].append(delays_s(part, list(sender.sent)))
                sequence = np.diff([message.seq for message in part.messages])
                complete.append(bool((sequence == 1).all()))
                held_mb.append(usage(server.process.pid).own_mb)

            for _ in range(pairs):
                measure("quiet")
                with company(server.addresses["hands"], CASES[case], "stopped" in case):
                    measure("company")
    p99 = {what: _p99(values) for what, values in parts.items()}
    ratio, low, high = _ratio(parts)
    grown_mb = max(held_mb) - held_mb[0]
    print(case, p99, ratio, (low, high), held_mb, file=sys.stderr, flush=True)
    return Row(
        f"{case}, {pairs} periods of {seconds:g} s",
        f"the measured subscriber's p99 within {100 * (P99_RATIO - 1):.0f} %, nothing lost, memory bounded",
        f"p99 {1e3 * p99['company']:.2f} ms, quiet {1e3 * p99['quiet']:.2f} ms: {ratio:.2f} times (95 %: {low:.2f} … "
        f"{high:.2f}); every message arrived: {all(complete)}; memory {grown_mb:+.1f} MB at most",
        ratio < P99_RATIO and all(complete) and grown_mb < HELD_MB,
        {"p99_s": {what: [float(np.percentile(v, 99)) for v in values] for what, values in parts.items()}}
        | {"p50_s": {what: [float(np.median(v)) for v in values] for what, values in parts.items()}, "own_mb": held_mb},
    )


def _ratio(parts: dict[str, list[np.ndarray]]) -> tuple[float, float, float]:
    """The ratio of the two p99, and its 95 % interval from resampling periods of about a second."""
    rng = np.random.default_rng(1)
    blocks = {
        what: [b for values in of_what for b in np.array_split(values, max(len(values) // 60, 1))]
        for what, of_what in parts.items()
    }

    def drawn(what: str) -> float:
        count = len(blocks[what])
        return _p99([blocks[what][i] for i in rng.integers(0, count, count)])

    low, high = np.percentile([drawn("company") / drawn("quiet") for _ in range(500)], (2.5, 97.5))
    return _p99(blocks["company"]) / _p99(blocks["quiet"]), float(low), float(high)


def _p99(parts: list[np.ndarray]) -> float:
    return float(np.percentile(np.concatenate(parts), 99))


def main() -> None:
    options = parser(__doc__, 10.0)
    options.add_argument(
        "--pairs", type=int, default=4, help="number of quiet and of crowded periods (default: %(default)s)"
    )
    arguments = options.parse_args()
    report("subscribers", [compare(case, arguments.seconds, arguments.pairs) for case in CASES], arguments.out)


if __name__ == "__main__":
    main()
