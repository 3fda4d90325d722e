"""Bodies over ZeroMQ, through real sockets on free loopback ports."""

import json
import socket
import threading

import msgpack
import pytest
import zmq

from manipnet.inputs.zeromq import ZEROMQ
from manipnet.inputs.zeromq.receiver import ZmqBodies
from manipnet.net.zmq_socket import MAX_WIRE_BYTES
from manipnet.wire.bodies import MAX_MESSAGE_BYTES


def message(frame):
    return {"t": frame / 120, "frame": frame, "bodies": [{"id": 1, "p": [0, 0, 0], "q": [0, 0, 0, 1]}]}


@pytest.fixture
def receiver(heard, telemetry):
    receiver = ZmqBodies(ZEROMQ.intake(heard, telemetry), port=0)
    receiver.start()
    yield receiver
    receiver.stop()


@pytest.fixture
def context():
    with zmq.Context() as context:
        yield context


def sender(context, address, kind=zmq.XPUB):
    """A publisher whose first message arrives, since it has received the subscription."""
    publisher = context.socket(kind)
    publisher.setsockopt(zmq.LINGER, 5_000)
    publisher.setsockopt(zmq.XPUB_VERBOSE, 1)
    publisher.connect(address)
    assert publisher.poll(20_000)
    assert publisher.recv() == b"\x01"
    return publisher


@pytest.mark.parametrize("encode", [msgpack.packb, lambda m: json.dumps(m).encode()])
def test_frames_arrive_in_order(receiver, heard, context, encode):
    with sender(context, receiver.address) as publisher:
        for n in range(20):
            publisher.send(encode(message(n)))
        frames = [heard.next() for _ in range(20)]
    assert [frame.frame for frame in frames] == list(range(20))
    assert frames[0].source.startswith("zmq:127.0.0.1#")
    assert frames[3].t_s == 3 / 120


def test_two_senders_have_two_sources(receiver, heard, context):
    with sender(context, receiver.address) as one, sender(context, receiver.address) as other:
        one.send(msgpack.packb(message(1)))
        first = heard.next()
        other.send(msgpack.packb(message(2)))
        assert heard.next().source != first.source


@pytest.mark.parametrize(
    ("send", "reason"),
    [
        (lambda socket: socket.send(b"garbage"), "malformed"),
        (lambda socket: socket.send(b""), "malformed"),
        (lambda socket: socket.send(b" " * (MAX_MESSAGE_BYTES + 1)), "oversized"),
        (lambda socket: socket.send_multipart([b"pose", msgpack.packb(message(0))]), "malformed"),
    ],
)
def test_good_frame_after_garbage(receiver, heard, telemetry, context, send, reason):
    with sender(context, receiver.address) as publisher:
        send(publisher)
        publisher.send(msgpack.packb(message(7)))
        assert heard.next().frame == 7
    assert telemetry.counts()["frames_dropped"] == {reason: 1}
    assert telemetry.counts()["frames_in"] == {"zmq": 1}


def test_a_huge_message_costs_only_its_sender_the_connection(receiver, heard, context):
    with sender(context, receiver.address) as good, sender(context, receiver.address) as bad:
        bad.send(b"x" * (MAX_WIRE_BYTES + 1))
        good.send(msgpack.packb(message(7)))
        assert heard.next().frame == 7
        assert bad.poll(20_000)  # it was cut off, reconnects and is subscribed to again
        assert bad.recv() == b"\x01"
        bad.send(msgpack.packb(message(8)))
        assert heard.next().frame == 8


def test_a_source_of_garbage_does_not_affect_another_source(receiver, heard, telemetry, context):
    with sender(context, receiver.address) as good, sender(context, receiver.address) as bad:
        for n in range(200):
            bad.send(b"garbage")
            good.send(msgpack.packb(message(n)))
        assert [heard.next().frame for _ in range(200)] == list(range(200))


def test_a_sink_that_fails_does_not_end_the_stream(telemetry, heard, context, caplog):
    def fussy(frame):
        if frame.frame == 0:
            raise RuntimeError("digest")
        heard(frame)

    receiver = ZmqBodies(ZEROMQ.intake(fussy, telemetry), port=0)
    receiver.start()
    try:
        with sender(context, receiver.address) as publisher:
            publisher.send(msgpack.packb(message(0)))
            publisher.send(msgpack.packb(message(1)))
            assert heard.next().frame == 1
    finally:
        receiver.stop()
    assert telemetry.counts()["frames_dropped"] == {"internal": 1}
    assert "digest" in caplog.text


@pytest.mark.parametrize("host", ["localhost", "::1"])
def test_other_spellings_of_loopback(heard, telemetry, context, host):
    receiver = ZmqBodies(ZEROMQ.intake(heard, telemetry), host=host, port=0)
    receiver.start()
    context.setsockopt(zmq.IPV6, 1)
    with sender(context, receiver.address) as publisher:
        publisher.send(msgpack.packb(message(1)))
        assert heard.next().frame == 1
    receiver.stop()


@pytest.fixture
def trackers(context):
    """Two trackers that bind their PUB sockets, and their addresses."""
    sockets = [context.socket(zmq.XPUB) for _ in range(2)]
    for each in sockets:
        each.setsockopt(zmq.LINGER, 0)
    yield [(each, ("127.0.0.1", each.bind_to_random_port("tcp://127.0.0.1"))) for each in sockets]
    for each in sockets:
        each.close()


def test_trackers_that_bind_are_connected_to(heard, telemetry, trackers, context):
    receiver = ZmqBodies(ZEROMQ.intake(heard, telemetry), port=0, trackers=tuple(address for _, address in trackers))
    receiver.start()
    for n, (tracker, _) in enumerate(trackers):
        assert tracker.poll(20_000)
        tracker.recv()
        tracker.send(msgpack.packb(message(n)))
        assert heard.next().frame == n
    with sender(context, receiver.address) as publisher:  # and others may still connect
        publisher.send(msgpack.packb(message(9)))
        assert heard.next().frame == 9
    addresses = [f"tcp://{host}:{port}" for _, (host, port) in trackers]
    assert receiver.status()["trackers"] == dict.fromkeys(addresses, True)
    receiver.stop()
    receiver.stop()


def bind_when_free(tracker, port):
    """Bind to a port whose former socket may still be closing."""
    for _ in range(2_000):
        try:
            return tracker.bind(f"tcp://127.0.0.1:{port}")
        except zmq.ZMQError:
            threading.Event().wait(0.01)
    raise AssertionError("the port stays in use")


def test_a_tracker_that_starts_late_and_restarts_is_found(heard, telemetry, context):
    with socket.socket() as reserved:  # the receiver's own port must be another one
        reserved.bind(("127.0.0.1", 0))
        port = reserved.getsockname()[1]
        receiver = ZmqBodies(ZEROMQ.intake(heard, telemetry), port=0, trackers=(("127.0.0.1", port),))
        receiver.start()
        assert receiver.status()["trackers"] == {f"tcp://127.0.0.1:{port}": False}
    for n in range(2):
        with context.socket(zmq.XPUB) as tracker:
            tracker.setsockopt(zmq.LINGER, 0)
            bind_when_free(tracker, port)
            assert tracker.poll(20_000)
            tracker.recv()
            tracker.send(msgpack.packb(message(n)))
            assert heard.next().frame == n
    receiver.stop()


def test_a_push_socket_is_refused_as_the_wrong_type(receiver, telemetry, context, caplog):
    with context.socket(zmq.PUSH) as push:
        push.setsockopt(zmq.LINGER, 0)
        push.connect(receiver.address)
        while "socket_type" not in telemetry.counts().get("connections_refused", {}):
            assert threading.Event().wait(0.02) is False
    assert "a PUSH, say): use a PUB socket that connects here" in caplog.text
    assert "keys" not in caplog.text


@pytest.mark.parametrize(("t_of", "fault"), [(lambda n: 0.0, "stands still"), (lambda n: 1e3 * n / 120, "jumps by")])
def test_a_t_that_is_no_clock_gives_way_to_the_arrival(receiver, heard, context, t_of, fault):
    with sender(context, receiver.address) as publisher:
        for n in range(40):
            publisher.send(msgpack.packb({**message(n), "t": t_of(n)}))
            frame = heard.next()
            threading.Event().wait(1 / 120)
    assert frame.t_s == pytest.approx(frame.t_received_s, abs=0.15)
    (report,) = receiver.status()["senders"].values()
    assert report["clock"]["used"] == "arrival"
    assert fault in report["clock"]["set_aside"]["t"]
