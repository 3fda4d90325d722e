"""Statistics of senders, from frames with simulated transit times."""

import random

import pytest

from manipnet.inputs.sender_stats import CLOCK_S, MOST, RATE_S, SenderStats
from manipnet.wire.bodies import BodyFrame, BodySample


def frames(rate_hz, seconds, offset_s=100.0, way_s=0.0, start_s=0.0, source="osc:a"):
    way = random.Random(3)
    for n in range(round(rate_hz * seconds)):
        t_s = start_s + n / rate_hz
        yield BodyFrame(t_s + offset_s, n, (), t_s + way_s * way.random(), source)


@pytest.fixture
def passed():
    return []


@pytest.fixture
def senders(passed):
    return SenderStats(passed.append)


def test_every_frame_is_passed_on_and_counted(senders, passed):
    given = list(frames(120, 3.0))
    for frame in given:
        senders(frame)
    assert passed == given
    (said,) = senders.report(3.0).values()
    assert said["frames"] == 360
    assert said["rate_hz"] == pytest.approx(120.0)
    assert said["age_s"] == pytest.approx(1 / 120)
    assert senders.report(3.0 + 3 * RATE_S)["osc:a"]["rate_hz"] == 0.0


@pytest.mark.parametrize("seconds", [0.7, 1.5, 3.0])
@pytest.mark.parametrize("rate_hz", [10, 90, 120])
def test_the_rate_of_each_body_is_known(senders, rate_hz, seconds):
    slow = BodySample(2, None, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), True)
    for n, frame in enumerate(frames(rate_hz, seconds)):
        fast = BodySample(1, None, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), n % 2 == 0)
        senders(BodyFrame(frame.t_s, n, (fast, slow) if n % 2 == 0 else (fast,), frame.t_received_s, frame.source))
    first, second = senders.report(seconds)["osc:a"]["bodies"]
    assert first["rate_hz"] == pytest.approx(rate_hz)
    assert second["rate_hz"] == pytest.approx(0.5 * rate_hz)
    assert first["tracked"] == pytest.approx(0.5, abs=0.5 / rate_hz + 0.1)


def test_what_has_been_silent_for_longer_than_a_second_has_no_rate(senders):
    body = BodySample(1, None, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), True)
    for frame in frames(120, 3.0):
        senders(frame._replace(bodies=(body,)))
    for silent_s, rate_hz in ((0.5, 120.0), (1.1, 0.0), (530.0, 0.0)):
        (sender,) = senders.report(3.0 + silent_s).values()
        assert sender["rate_hz"] == sender["bodies"][0]["rate_hz"] == pytest.approx(rate_hz)
        assert sender["age_s"] == sender["bodies"][0]["age_s"] == pytest.approx(silent_s + 1 / 120)


def test_what_arrives_in_one_burst_at_first_tells_no_rate(senders):
    body = BodySample(1, None, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), True)
    waited = [BodyFrame(n / 100 - 2.0, n, (body,), 2e-5 * n, "zmq:a") for n in range(200)]
    fresh = [BodyFrame(n / 100, n, (body,), n / 100, "zmq:a") for n in range(1, 350)]
    for frame in waited:
        senders(frame)
    (reported,) = senders.report(0.01).values()
    assert reported["frames"] == 200
    assert reported["rate_hz"] == reported["bodies"][0]["rate_hz"] == 0.0
    assert reported["bodies"][0]["tracked"] == 1.0
    for frame in fresh:
        senders(frame)
        (reported,) = senders.report(frame.t_received_s).values()
        for rate_hz in (reported["rate_hz"], reported["bodies"][0]["rate_hz"]):
            assert rate_hz == 0.0 or rate_hz == pytest.approx(100.0)
        assert reported["clock_speed"] is None or reported["clock_speed"] == pytest.approx(1.0)
        assert reported["bodies"][0]["tracked"] == pytest.approx(1.0)
    assert reported["rate_hz"] == reported["bodies"][0]["rate_hz"] == pytest.approx(100.0)


def test_the_fastest_frame_gives_the_clock_offset(senders):
    for frame in frames(120, 5.0, way_s=0.05):
        senders(frame)
    offset_s = senders.report(5.0)["osc:a"]["clock_offset_s"]
    assert 100.0 - 2e-3 < offset_s <= 100.0
    assert senders.report(5.0)["osc:a"]["clock_uncertainty_s"] is None


def test_a_clock_that_drifts_is_followed(senders):
    for step in range(100):
        for frame in frames(30, 1.0, offset_s=100.0 - 1e-4 * step, start_s=float(step)):
            senders(frame)
    offset_s = senders.report(100.0)["osc:a"]["clock_offset_s"]
    assert abs(offset_s - (100.0 - 1e-4 * 99)) < 2.1 * CLOCK_S * 1e-4


def test_a_sender_that_restarts_has_another_clock(senders):
    for frame in [*frames(60, 5.0), *frames(60, 1.0, offset_s=-5.0, start_s=5.0)]:
        senders(frame)
    assert senders.report(6.0)["osc:a"]["clock_offset_s"] == pytest.approx(-5.0)
    assert senders.report(6.0)["osc:a"]["frames"] == 360


def test_memory_is_bounded_and_the_newest_are_kept(senders):
    for n in range(3 * MOST):
        senders(BodyFrame(1.0, n, (), 0.0, f"osc:{n}"))
    assert set(senders.report(1.0)) == {f"osc:{n}" for n in range(2 * MOST, 3 * MOST)}
