"""Bodies through a bad network: how many ticks come out, how far a joint jumps, how soon a blackhole is forgotten.

The same stretch of the same performance goes through a seeded proxy, by OSC over UDP and by ZeroMQ message by message,
first through a clean one. A tick counts when its hands message came, and as live when both hands were synthesised from
fresh tracking; the first second, before the window is full, does not count. Steps are the largest between two messages
in a row, of a finger joint's angle and of any joint in the world, compared with the clean run of that look-ahead.
"""

import itertools
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np
from live_server import LiveServer, serving
from simulated_link import Proxy, UdpProxy, Weather, ZmqProxy

from manipnet.tracking.tick import TICK_HZ
from manipnet.wire import HandsMessage
from manipnet_tools.bench.scenarios import Performance

from .live import Watched, osc_sender, playing, watching, zmq_sender
from .motion import frames, motion
from .row import Row, parser, report

RATE_HZ = 120.0
SETTLE_S, DRAIN_S = 1.0, 1.5
BLACKHOLE_S, RECOVERY_S = 3.0, 0.2
SHARE, STEPS = 0.98, 2.0
CLEAN = Weather()
WEATHERS = (
    Weather(0.02, 0.02, 0.005, 0.0, 0.01),
    Weather(0.05, 0.08, 0.02, 0.25, 0.02),
    Weather(0.10, 0.08, 0.02, 0.25, 0.02),
    Weather(0.10, 0.3, 0.1, 0.25, 0.05),
)
BOUND = Weather(0.05, 0.08, 0.02)
"""The target is set up to this loss and delay."""
LOOK_AHEADS_S = (0.5, 0.1, 0.0)
WAYS = {"osc": ("osc", UdpProxy, osc_sender), "zmq": ("bodies", ZmqProxy, zmq_sender)}


@dataclass(frozen=True)
class Outcome:
    """Shares of ticks, and the largest steps between neighbours."""

    shown: float
    live: float
    step_rad: float
    step_m: float
    lost: float


def perform(
    server: LiveServer,
    performance: Performance,
    way: str,
    weather: Weather,
    seed: int,
    seconds: float,
    during: Callable[[Proxy], None] = lambda proxy: None,
) -> tuple[Watched, Proxy]:
    """Play through a proxy until the last tick is out; `during` runs meanwhile."""
    socket, kind, sender = WAYS[way]
    proxy = kind(server.addresses[socket], weather, seed)
    with watching(server.addresses["hands"]) as watched:
        with playing(frames(performance, seconds), sender(proxy.address)) as thread:
            during(proxy)
            thread.join()
            time.sleep(DRAIN_S + weather.delay_s)  # what is on its way, and the look-ahead after it
        proxy.close()
    return watched, proxy


def outcome(watched: Watched, proxy: Proxy, seconds: float) -> Outcome:
    """Of the ticks between the settling and the end of what was sent."""
    kept = [m for m in watched.messages if SETTLE_S <= m.t_capture < seconds]
    expected = (seconds - SETTLE_S) * TICK_HZ
    instants = {round(m.t_capture * TICK_HZ) for m in kept}
    live = {round(m.t_capture * TICK_HZ) for m in kept if _live(m)}
    steps = Watched([0.0] * len(kept), kept).largest_steps()
    lost = proxy.lost / max(proxy.lost + proxy.passed, 1)
    return Outcome(len(instants) / expected, len(live) / expected, *steps, lost)


@dataclass(frozen=True)
class Recovery:
    """Seconds from the first frame through to the first live hands, less the look-ahead, and steps on the way back."""

    seconds: float
    step_rad: float
    step_m: float


def recovery(server: LiveServer, performance: Performance, way: str, seed: int, look_ahead_s: float) -> Recovery:
    """What a blackhole in the middle of a performance costs after its end."""
    back: list[float] = []

    def hole(proxy: Proxy) -> None:
        time.sleep(SETTLE_S + 1.0)
        proxy.blackhole = True
        time.sleep(BLACKHOLE_S)
        passed = proxy.passed
        proxy.blackhole = False
        while proxy.passed == passed:
            time.sleep(0.0005)
        back.append(time.monotonic())

    watched, _ = perform(server, performance, way, CLEAN, seed, SETTLE_S + 1.0 + BLACKHOLE_S + 3.0, hole)
    after = watched.since(back[0])
    live_s = next(m.t_publish for m in after.messages if _live(m)) - back[0]
    return Recovery(live_s - look_ahead_s, *after.since(back[0], back[0] + live_s + 1.0).largest_steps())


def _live(message: HandsMessage) -> bool:
    return bool(message.hands) and all(hand.state == "live" for hand in message.hands.values())


def main() -> None:
    options = parser(__doc__, 15.0)
    options.add_argument("--way", action="append", choices=WAYS, help="only this; repeatable")
    options.add_argument("--look-ahead", action="append", type=float, metavar="SECONDS", help="only this; repeatable")
    options.add_argument("--holes", type=int, default=5, help="blackholes for each way (default: %(default)s)")
    arguments = options.parse_args()
    performance = motion(RATE_HZ)
    meshes = [f"--mesh={name}={path}" for name, path in performance.meshes.items()]
    rows = []
    for way, look_ahead_s in itertools.product(arguments.way or WAYS, arguments.look_ahead or LOOK_AHEADS_S):
        options = (*meshes, "--look-ahead", str(look_ahead_s))
        outcomes = {}
        for weather in (CLEAN, *WEATHERS):
            with serving(*options) as server:
                watched, proxy = perform(server, performance, way, weather, arguments.seed, arguments.seconds)
            outcomes[weather] = outcome(watched, proxy, arguments.seconds)
            print(way, look_ahead_s, weather, outcomes[weather], file=sys.stderr, flush=True)
        about = f"{way}, look-ahead {1e3 * look_ahead_s:g} ms"
        rows += [_link_row(about, weather, outcomes[weather], outcomes[CLEAN]) for weather in (CLEAN, *WEATHERS)]
        with serving(*options) as server:
            times = [recovery(server, performance, way, k, look_ahead_s) for k in range(arguments.holes)]
        print(way, look_ahead_s, times, file=sys.stderr, flush=True)
        rows.append(_hole_row(about, times))
    report("lossy_link", rows, arguments.out)


def _link_row(about: str, weather: Weather, got: Outcome, clean: Outcome) -> Row:
    bound = weather.loss <= BOUND.loss and weather.delay_s <= BOUND.delay_s
    ratios = got.step_rad / clean.step_rad, got.step_m / clean.step_m
    return Row(
        f"{about}: {weather}",
        f"≥ {100 * SHARE:g} % of ticks, joint steps ≤ {STEPS:g} times clean"
        if bound
        else f"steps ≤ {STEPS:g} times clean",
        f"{100 * got.shown:.2f} % of ticks, {100 * got.live:.2f} % live; largest step {np.degrees(got.step_rad):.2f}° "
        f"({ratios[0]:.2f} times), {1e3 * got.step_m:.1f} mm ({ratios[1]:.2f} times)",
        max(ratios) <= STEPS and (not bound or min(got.shown, got.live) >= SHARE),
        {"shown": got.shown, "live": got.live, "step_rad": got.step_rad, "step_m": got.step_m, "lost": got.lost},
    )


def _hole_row(about: str, times: list[Recovery]) -> Row:
    seconds = [time.seconds for time in times]
    return Row(
        f"{about}: blackhole of {BLACKHOLE_S:g} s, {len(times)} times",
        f"live again < {1e3 * RECOVERY_S:g} ms after the look-ahead",
        f"{1e3 * np.median(seconds):.0f} ms median, {1e3 * max(seconds):.0f} ms at most; largest step on the way back "
        f"{np.degrees(max(time.step_rad for time in times)):.1f}°, {1e3 * max(time.step_m for time in times):.0f} mm",
        max(seconds) < RECOVERY_S,
        {"recoveries": [asdict(time) for time in times]},
    )


if __name__ == "__main__":
    main()
