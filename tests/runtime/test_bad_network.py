"""Frames that are lost, late, out of order and duplicated, by a clock that the test steps: no tick is missing, no jump.

The same links with real sockets, servers and time are measured by `python -m benchmarks.reliability.lossy_link`.
"""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from live_server import scene
from simulated_link import Link, LinkQuality
from test_tick_loop import Bench, actor, frame

from manipnet.actors.props import Prop
from manipnet.runtime.object_catalog import ObjectCatalog
from manipnet.synthesis.model.bundle import Bundle, load_bundle
from manipnet.telemetry import Telemetry
from manipnet.tracking.tick import TICK_HZ, TICK_S
from manipnet.wire import HandsMessage

RATE_HZ, SECONDS, SETTLE_S, STEP_S = 120.0, 4.0, 1.0, 0.002
BAD = LinkQuality(loss=0.05, delay_s=0.08, jitter_s=0.02, reorder=0.25, duplicate=0.02)
WORSE = LinkQuality(loss=0.1, delay_s=0.3, jitter_s=0.1, reorder=0.25, duplicate=0.05)

Arrive = Callable[[float], list[float]]
"""From the time a frame was sent to the times it arrives: none, one or two."""


@pytest.fixture(scope="module")
def bundle(tiny_bundle: Path) -> Bundle:
    return load_bundle(tiny_bundle)


@pytest.fixture
def receive(bundle: Bundle, tmp_path: Path):
    """Play the scene over a network; returns the messages of the settled part."""
    shape = ObjectCatalog().shape("cube")

    def run(arrive: Arrive, look_ahead_s: float) -> list[HandsMessage]:
        telemetry = Telemetry()
        one = actor(bundle, ObjectCatalog(), telemetry, Prop("Box", "cube", shape))
        one.look_ahead_s = look_ahead_s
        bench = Bench(bundle, tmp_path, [one], telemetry)
        sent = [i / RATE_HZ for i in range(round(SECONDS * RATE_HZ))]
        arrivals = sorted((at_s, t_s) for t_s in sent for at_s in arrive(t_s))
        for now_s in np.arange(0.0, SECONDS + 1.0, STEP_S).tolist():
            while arrivals and arrivals[0][0] <= now_s:
                at_s, t_s = arrivals.pop(0)
                bench.mailbox.put(frame(t_s, scene(t_s))._replace(t_received_s=at_s))
            bench.loop.take_in(0.0)
            while bench.loop.step(now_s):
                pass
        return [m for m in bench.messages if SETTLE_S <= m.t_capture < SECONDS - 0.5]

    return run


def over(weather: LinkQuality) -> Arrive:
    link = Link(weather, seed=1)
    return lambda t_s: [t_s + delay_s for delay_s in link.delays_s()]


def stalled(begin_s: float, length_s: float) -> Arrive:
    """A network that stalls: what would arrive during the stall arrives at its end."""
    return lambda t_s: [begin_s + length_s if begin_s <= t_s < begin_s + length_s else t_s]


def largest_steps(messages: list[HandsMessage]) -> tuple[float, float]:
    """The largest step from one message to the next of any finger's angle, radians, and of a wrist, metres."""
    turns, ways = [], []
    for a, b in pairwise(messages):
        for side, hand in b.hands.items():
            turns.append(np.abs(hand.angles - a.hands[side].angles).max())
            ways.append(np.linalg.norm(hand.wrist[:3] - a.hands[side].wrist[:3]))
    return float(max(turns)), float(max(ways))


def assert_every_tick(messages: list[HandsMessage]) -> None:
    assert len(messages) == round((SECONDS - 0.5 - SETTLE_S) * TICK_HZ)
    assert np.allclose(np.diff([m.t_capture for m in messages]), TICK_S)


@pytest.mark.parametrize("look_ahead_s", [0.5, 0.1, 0.0])
@pytest.mark.parametrize("weather", [BAD, WORSE], ids=str)
def test_every_tick_comes_out_of_a_bad_network_without_a_jump(
    receive, weather: LinkQuality, look_ahead_s: float
) -> None:
    clean, messages = receive(over(LinkQuality()), look_ahead_s), receive(over(weather), look_ahead_s)
    assert_every_tick(messages)
    if look_ahead_s >= weather.jitter_s:
        assert {hand.state for m in messages for hand in m.hands.values()} == {"live"}
    for step, clean_step in zip(largest_steps(messages), largest_steps(clean), strict=True):
        assert step <= (2.0 if weather is BAD else 3.0) * clean_step


@pytest.mark.parametrize(("look_ahead_s", "stall_s"), [(0.0, 0.07), (0.0, 0.1), (0.1, 0.15), (0.1, 0.2)])
def test_a_wrist_that_stood_still_for_lack_of_frames_glides_to_where_it_is(
    receive, look_ahead_s: float, stall_s: float
) -> None:
    clean, messages = receive(stalled(0.0, 0.0), look_ahead_s), receive(stalled(2.1, stall_s), look_ahead_s)
    assert_every_tick(messages)
    for step, clean_step in zip(largest_steps(messages), largest_steps(clean), strict=True):
        assert step <= 2.0 * clean_step
    truth = scene(messages[-1].t_capture)["right_wrist"]
    assert np.allclose(messages[-1].hands["right"].wrist[:3], truth[:3], atol=2e-3)
