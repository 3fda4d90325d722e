"""Messages that have waited for the server are used if they say when they were captured, and are named otherwise."""

import msgpack
import pytest

from manipnet.inputs.zeromq import ZEROMQ
from manipnet.inputs.zeromq.messages import BodyMessages
from manipnet.inputs.zeromq.sender import BACKLOG_S

WAITED = 190
HZ = 100.0
SOURCE = "zmq:127.0.0.1#7"


def body(id):
    return {"id": id, "p": [0, 0, 0], "q": [0, 0, 0, 1]}


def message(t_s, *bodies):
    return msgpack.packb({"t": t_s, "bodies": list(bodies or [body(1)])}) or b""


@pytest.fixture
def received():
    return []


@pytest.fixture
def messages(received, telemetry):
    return BodyMessages(ZEROMQ.intake(received.append, telemetry))


@pytest.fixture
def dropped(telemetry):
    return lambda: telemetry.counts().get("frames_dropped", {})


def burst(messages, t_of, start_s=50.0, count=WAITED):
    for n in range(count):
        messages.receive(message(t_of(n)), SOURCE, start_s + 1e-4 * n)


@pytest.mark.parametrize(
    "t_of",
    [lambda n: 0.0, lambda n: float(n // 1000), lambda n: 1e3 * n / HZ],
    ids=["always zero", "whole seconds", "milliseconds"],
)
def test_what_has_waited_without_a_clock_is_set_aside_and_named(t_of, messages, dropped, caplog):
    burst(messages, t_of)
    assert dropped().keys() == {"backlog"}
    assert dropped()["backlog"] >= WAITED - 6
    assert "has waited for the server" in caplog.text
    before = dropped()["backlog"]
    for n in range(WAITED, 2 * WAITED):
        messages.receive(message(t_of(n)), SOURCE, 50.0 + n / HZ)
    assert dropped() == {"backlog": before}


def test_what_has_waited_with_a_clock_is_used(messages, dropped, received):
    burst(messages, lambda n: n / HZ)
    assert not dropped()
    assert [frame.t_s for frame in received] == pytest.approx([n / HZ for n in range(WAITED)])


def test_what_has_waited_through_an_interruption_is_recognised_too(messages, dropped):
    for n in range(200):
        messages.receive(message(0.0), SOURCE, 50.0 + n / HZ)
    assert not dropped()
    burst(messages, lambda n: 0.0, start_s=52.0 + 2.0 * BACKLOG_S)
    assert dropped() == {"backlog": WAITED - 1}


def test_bodies_in_messages_of_their_own_have_not_waited(messages, dropped):
    for n in range(200):
        for i in range(3):
            messages.receive(message(0.0, body(i)), SOURCE, 50.0 + n / HZ + 1e-4 * i)
    assert not dropped()


def test_bunches_in_a_running_stream_are_not_a_backlog(messages, dropped):
    for n in range(400):
        messages.receive(message(0.0), SOURCE, 50.0 + n / HZ)
    burst(messages, lambda n: 0.0, start_s=54.0, count=5)
    assert not dropped()
