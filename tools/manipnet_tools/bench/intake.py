"""What one frame costs from its bytes to the frame that the tick thread gets, for each protocol that delivers bodies.

A receiver takes frames as its socket would hand them over. Parsing, the sender's clock and the statistics of its bodies
are included; the socket itself is not.
"""

import json
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import msgpack
import numpy as np

from manipnet.inputs.natnet import NATNET
from manipnet.inputs.natnet.client import NatNetBodies
from manipnet.inputs.natnet.options import NatNetOptions
from manipnet.inputs.osc import OSC
from manipnet.inputs.osc.receiver import OscBodies
from manipnet.inputs.sender_stats import SenderStats
from manipnet.inputs.zeromq import ZEROMQ
from manipnet.inputs.zeromq.messages import BodyMessages
from manipnet.telemetry import Telemetry
from manipnet.wire.bodies import BodyFrame, BodySample, bodies_map
from manipnet_tools.bench.harness import TURN
from manipnet_tools.bench.packets import Datagrams, natnet_packets, natnet_setup, osc_bundle_of, osc_messages_of, vmc_of

BODIES: Final = (3, 20)
BONES: Final = 21
RATE_HZ: Final = 120.0
FRAMES: Final = 600
CHUNK: Final = 60
"""Frames of one case that are timed in a row."""
_SENDER: Final = ("127.0.0.1", 49_152)
_Take = Callable[[bytes, float], None]
"""Takes a datagram that arrives at a time."""


@dataclass(frozen=True)
class Case:
    """One format with some number of bodies: what writes its frames, and what makes a receiver that takes them."""

    name: str
    bodies: int
    write: Callable[[BodyFrame], Datagrams]
    open: Callable[[SenderStats], _Take]


def cases() -> list[Case]:
    """Every format with every number of bodies."""
    formats: list[tuple[str, Callable[[BodyFrame], Datagrams], Callable[[SenderStats], _Take]]] = [
        ("msgpack", lambda frame: [msgpack.packb(bodies_map(frame)) or b""], _zeromq),
        ("JSON", lambda frame: [json.dumps(bodies_map(frame)).encode()], _zeromq),
        ("OSC messages", osc_messages_of, _osc),
        ("OSC bundle", osc_bundle_of, _osc),
        ("OSC, VMC and bones", lambda frame: vmc_of(frame, BONES), _osc),
        ("NatNet", lambda frame: natnet_packets(frame, 0), _natnet),
        ("NatNet and bones", lambda frame: natnet_packets(frame, BONES), _natnet),
    ]
    return [Case(f"{name}, {count}", count, write, open) for count in BODIES for name, write, open in formats]


def time_cases(reference: Callable[[], object], seconds: float) -> dict[str, np.ndarray]:
    """Seconds a frame of each case, and of a pass of the `reference`, which have short turns one after another."""
    found: dict[str, list[float]] = {"reference": []}
    feeds = {case.name: _feed(case) for case in cases()}
    end_s = time.perf_counter() + seconds
    while time.perf_counter() < end_s or len(found["reference"]) < 4 * TURN:
        for _ in range(TURN):
            start_s = time.perf_counter()
            reference()
            found["reference"].append(time.perf_counter() - start_s)
        for name, feed in feeds.items():
            found.setdefault(name, []).append(next(feed))
    return {name: np.array(durations) for name, durations in found.items()}


def _feed(case: Case) -> Iterator[float]:
    """Feed frames without end. Yields the seconds that a frame has cost, once for each chunk."""
    frames = [case.write(frame_of(n, case.bodies)) for n in range(FRAMES)]
    chunks = [frames[i : i + CHUNK] for i in range(0, FRAMES, CHUNK)]
    while True:
        take = case.open(SenderStats(lambda frame: None))
        for i, chunk in enumerate(chunks):
            yield _time(take, chunk, i * CHUNK)


def _time(take: _Take, frames: Sequence[Datagrams], first: int) -> float:
    start_s = time.perf_counter()
    for n, datagrams in enumerate(frames, first):
        for datagram in datagrams:
            take(datagram, n / RATE_HZ)
    return (time.perf_counter() - start_s) / len(frames)


def frame_of(n: int, count: int) -> BodyFrame:
    """The frame number `n` of bodies that move a little from frame to frame."""
    angle = 0.02 * n
    q = (0.0, float(np.sin(angle)), 0.0, float(np.cos(angle)))
    samples = [BodySample(i, None, (0.1 * i, 1.0 + 1e-3 * n, 0.01 * angle), q, True) for i in range(1, count + 1)]
    return BodyFrame(n / RATE_HZ, n, tuple(samples), n / RATE_HZ, "bench")


def _zeromq(stats: SenderStats) -> _Take:
    messages = BodyMessages(ZEROMQ.intake(stats, Telemetry()))
    return lambda message, now_s: messages.receive(message, "zmq:bench", now_s)


def _osc(stats: SenderStats) -> _Take:
    receiver = OscBodies(OSC.intake(stats, Telemetry()))
    return lambda datagram, now_s: receiver.receive(datagram, _SENDER, now_s)


def _natnet(stats: SenderStats) -> _Take:
    receiver = NatNetBodies(NATNET.intake(stats, Telemetry()), NatNetOptions(natnet=_SENDER))
    for packet in natnet_setup(max(BODIES), BONES):
        receiver.receive(packet, _SENDER, 0.0)
    return lambda packet, now_s: receiver.receive(packet, _SENDER, now_s)
