"""Bodies over a bad network: how many ticks are published, how far joints jump, how soon an outage is over.

The same motion goes through a seeded proxy, as OSC over UDP and as ZeroMQ messages, first through a clean one. A tick
counts as published when its hands message arrives, and as live when both hands were synthesised from fresh tracking.
The first second, before the window is full, does not count. The steps are the largest changes between two messages in
a row, of an angle and of any joint in the world; they are compared with the clean run at the same look-ahead.
"""

import itertools
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np

from benchmarks.support import LinkQuality, LiveServer, Proxy, UdpProxy, ZmqProxy, serving
from benchmarks.traffic import Received, osc_sender, playing, receiving, zmq_sender
from manipnet.tracking.tick import TICK_HZ
from manipnet.wire import HandsMessage
from manipnet_tools.bench.scenarios import Scenario

from .motion import frames, mesh_options, motion
from .row import Row, parser, report

RATE_HZ = 120.0
SETTLE_S, DRAIN_S = 1.0, 1.5
OUTAGE_S, RECOVERY_S = 3.0, 0.2
SHARE, STEPS = 0.98, 2.0
CLEAN = LinkQuality()
BAD = (
    LinkQuality(0.02, 0.02, 0.005, 0.0, 0.01),
    LinkQuality(0.05, 0.08, 0.02, 0.25, 0.02),
    LinkQuality(0.10, 0.08, 0.02, 0.25, 0.02),
    LinkQuality(0.10, 0.3, 0.1, 0.25, 0.05),
)
BOUND = LinkQuality(0.05, 0.08, 0.02)
"""The target is valid up to this loss and delay."""
LOOK_AHEADS_S = (0.5, 0.1, 0.0)
PROTOCOLS = {"osc": ("osc", UdpProxy, osc_sender), "zmq": ("bodies", ZmqProxy, zmq_sender)}


@dataclass(frozen=True)
class Outcome:
    """Shares of ticks that were published and that were live, the largest steps, and the share of packets lost."""

    published: float
    live: float
    step_rad: float
    step_m: float
    lost: float


def perform(
    server: LiveServer,
    scenario: Scenario,
    protocol: str,
    quality: LinkQuality,
    seed: int,
    seconds: float,
    during: Callable[[Proxy], None] = lambda proxy: None,
) -> tuple[Received, Proxy]:
    """Play through a proxy until the last tick is published, and call `during` meanwhile."""
    socket, kind, sender = PROTOCOLS[protocol]
    proxy = kind(server.addresses[socket], quality, seed)
    with receiving(server.addresses["hands"]) as received:
        with playing(frames(scenario, seconds), sender(proxy.address)) as thread:
            during(proxy)
            thread.join()
            time.sleep(DRAIN_S + quality.delay_s)  # for delayed packets and the look-ahead
        proxy.close()
    return received, proxy


def outcome(received: Received, proxy: Proxy, seconds: float) -> Outcome:
    """The outcome for the ticks between the settling time and the end of the motion."""
    kept = [m for m in received.messages if SETTLE_S <= m.t_capture < seconds]
    expected = (seconds - SETTLE_S) * TICK_HZ
    instants = {round(m.t_capture * TICK_HZ) for m in kept}
    live = {round(m.t_capture * TICK_HZ) for m in kept if _live(m)}
    steps = Received([0.0] * len(kept), kept).largest_steps()
    lost = proxy.lost / max(proxy.lost + proxy.passed, 1)
    return Outcome(len(instants) / expected, len(live) / expected, *steps, lost)


@dataclass(frozen=True)
class Recovery:
    """Seconds from the first frame after an outage to the first live hands, less the look-ahead; largest steps then."""

    seconds: float
    step_rad: float
    step_m: float


def recovery(server: LiveServer, scenario: Scenario, protocol: str, seed: int, look_ahead_s: float) -> Recovery:
    """Measure the recovery from an outage in the middle of the motion."""
    back: list[float] = []

    def interrupt(proxy: Proxy) -> None:
        time.sleep(SETTLE_S + 1.0)
        proxy.blackhole = True
        time.sleep(OUTAGE_S)
        passed = proxy.passed
        proxy.blackhole = False
        while proxy.passed == passed:
            time.sleep(0.0005)
        back.append(time.monotonic())

    received, _ = perform(server, scenario, protocol, CLEAN, seed, SETTLE_S + 1.0 + OUTAGE_S + 3.0, interrupt)
    after = received.since(back[0])
    live_s = next(m.t_publish for m in after.messages if _live(m)) - back[0]
    return Recovery(live_s - look_ahead_s, *after.since(back[0], back[0] + live_s + 1.0).largest_steps())


def _live(message: HandsMessage) -> bool:
    return bool(message.hands) and all(hand.state == "live" for hand in message.hands.values())


def main() -> None:
    options = parser(__doc__, 15.0)
    options.add_argument("--protocol", action="append", choices=PROTOCOLS, help="only this one; repeatable")
    options.add_argument(
        "--look-ahead", action="append", type=float, metavar="SECONDS", help="only this one; repeatable"
    )
    options.add_argument("--outages", type=int, default=5, help="outages for each protocol (default: %(default)s)")
    arguments = options.parse_args()
    scenario = motion(RATE_HZ)
    rows = []
    for protocol, look_ahead_s in itertools.product(
        arguments.protocol or PROTOCOLS, arguments.look_ahead or LOOK_AHEADS_S
    ):
        server_options = (*mesh_options(scenario), "--look-ahead", str(look_ahead_s))
        outcomes = {}
        for quality in (CLEAN, *BAD):
            with serving(*server_options) as server:
                received, proxy = perform(server, scenario, protocol, quality, arguments.seed, arguments.seconds)
            outcomes[quality] = outcome(received, proxy, arguments.seconds)
            print(protocol, look_ahead_s, quality, outcomes[quality], file=sys.stderr, flush=True)
        about = f"{protocol}, look-ahead {1e3 * look_ahead_s:g} ms"
        rows += [_link_row(about, quality, outcomes[quality], outcomes[CLEAN]) for quality in (CLEAN, *BAD)]
        with serving(*server_options) as server:
            recoveries = [recovery(server, scenario, protocol, k, look_ahead_s) for k in range(arguments.outages)]
        print(protocol, look_ahead_s, recoveries, file=sys.stderr, flush=True)
        rows.append(_outage_row(about, recoveries))
    report("lossy_link", rows, arguments.out)


def _link_row(about: str, quality: LinkQuality, got: Outcome, clean: Outcome) -> Row:
    bound = quality.loss <= BOUND.loss and quality.delay_s <= BOUND.delay_s
    ratios = got.step_rad / clean.step_rad, got.step_m / clean.step_m
    return Row(
        f"{about}: {quality}",
        f"≥ {100 * SHARE:g} % of ticks, joint steps ≤ {STEPS:g} times clean"
        if bound
        else f"steps ≤ {STEPS:g} times clean",
        f"{100 * got.published:.2f} % of ticks, {100 * got.live:.2f} % live; largest step "
        f"{np.degrees(got.step_rad):.2f}° ({ratios[0]:.2f} times), {1e3 * got.step_m:.1f} mm ({ratios[1]:.2f} times)",
        max(ratios) <= STEPS and (not bound or min(got.published, got.live) >= SHARE),
        {
            "published": got.published,
            "live": got.live,
            "step_rad": got.step_rad,
            "step_m": got.step_m,
            "lost": got.lost,
        },
    )


def _outage_row(about: str, recoveries: list[Recovery]) -> Row:
    seconds = [recovery.seconds for recovery in recoveries]
    step_rad, step_m = (max(getattr(r, name) for r in recoveries) for name in ("step_rad", "step_m"))
    return Row(
        f"{about}: outage of {OUTAGE_S:g} s, {len(recoveries)} times",
        f"live again < {1e3 * RECOVERY_S:g} ms after the look-ahead",
        f"{1e3 * np.median(seconds):.0f} ms median, {1e3 * max(seconds):.0f} ms at most; largest step during the "
        f"recovery {np.degrees(step_rad):.1f}°, {1e3 * step_m:.0f} mm",
        max(seconds) < RECOVERY_S,
        {"recoveries": [asdict(recovery) for recovery in recoveries]},
    )


if __name__ == "__main__":
    main()
