"""Clocks that cannot be right are named in the log, with the remedy and at a limited rate."""

import pytest

from manipnet.inputs.sender_stats import SenderStats
from manipnet.runtime.clock_watch import ClockWatch
from manipnet.wire.bodies import BodyFrame


def run(step_s: float, seconds: int = 10) -> None:
    """A sender at 120 Hz whose times advance by `step_s` for each frame."""
    watch, senders = ClockWatch(), SenderStats(lambda _: None)
    for i in range(120 * seconds):
        senders(BodyFrame(1000.0 + i * step_s, i, (), i / 120.0, "zmq:a"))
        if i % 120 == 119:
            watch.look(senders.report(i / 120.0), {})


@pytest.mark.parametrize(
    ("step_s", "expected"),
    [
        (1000.0 / 120.0, "advance by 1e+03 per second, so they are not in seconds; send t in seconds"),
        (0.5 / 120.0, "runs at 0.50 times real time"),
        (2.0 / 120.0, "runs at 2.00 times real time"),
        (0.0, "its times do not rise"),
    ],
)
def test_a_wrong_clock_is_named_once(step_s: float, expected: str, caplog: pytest.LogCaptureFixture) -> None:
    run(step_s)
    assert len(caplog.records) == 1
    assert expected in caplog.text


def test_a_good_clock_is_not_mentioned(caplog: pytest.LogCaptureFixture) -> None:
    run(1.03 / 120.0)
    assert caplog.text == ""


def test_a_replay_that_begins_again_is_not_mentioned(caplog: pytest.LogCaptureFixture) -> None:
    watch, senders = ClockWatch(), SenderStats(lambda _: None)
    for i in range(1200):
        senders(BodyFrame((i % 480) / 120.0, i, (), i / 120.0, "zmq:a"))
        if i % 120 == 119:
            watch.look(senders.report(i / 120.0), {})
    assert caplog.text == ""


def test_a_clock_that_is_never_believed_is_named(caplog: pytest.LogCaptureFixture) -> None:
    watch = ClockWatch()
    for second in range(1, 8):
        watch.look({}, {"frames_in": {"zmq": 120 * second}, "frames_dropped": {"time_jump": 119 * second}})
    assert len(caplog.records) == 1
    assert "nearly all frames are dropped (time_jump)" in caplog.text
