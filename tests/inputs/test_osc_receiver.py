"""Bodies over OSC, through real UDP sockets on free loopback ports."""

import ipaddress
import random
import socket

import pytest
from osc_writer import bundle, osc

from manipnet.inputs.osc import OSC
from manipnet.inputs.osc.receiver import MAX_SENDERS, OscBodies
from manipnet.net.rate_limit import FAULTS_PER_S

P, Q = (0.5, 1.0, -2.0), (0.0, 0.6, 0.0, 0.8)


def pose(key):
    return osc(f"/rigidbody/{key}/transformation", *P, *Q)


def frame(n, *keys):
    return bundle(osc("/frame/start", n), *map(pose, keys), osc("/frame/end", n))


@pytest.fixture
def receiver(heard, telemetry):
    receiver = OscBodies(OSC.intake(heard, telemetry), port=0)
    receiver.start()
    yield receiver
    receiver.stop()


@pytest.fixture
def sockets():
    made = []
    yield made
    for udp in made:
        udp.close()


def sender(sockets, receiver):
    """A connected socket: `send` reaches the receiver."""
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sockets.append(udp)
    udp.connect(("127.0.0.1", int(receiver.address.rpartition(":")[2])))
    return udp


def test_bundled_frames_arrive_in_order(receiver, heard, sockets):
    udp = sender(sockets, receiver)
    for n in range(30):
        udp.send(frame(n, 1, "Box"))
    frames = [heard.next() for _ in range(30)]
    assert [f.frame for f in frames] == list(range(30))
    assert [body.name for body in frames[0].bodies] == [None, "Box"]
    assert frames[0].source == f"osc:127.0.0.1:{udp.getsockname()[1]}"


def test_unmarked_messages_become_a_frame_after_a_gap(receiver, heard, sockets):
    udp = sender(sockets, receiver)
    udp.send(osc("/rigidbody/1/position", *P))
    udp.send(osc("/rigidbody/1/quat", *Q))
    assert heard.next().bodies[0].p == P


def test_messages_of_two_senders_are_not_mixed(receiver, heard, sockets):
    one, other = sender(sockets, receiver), sender(sockets, receiver)
    for udp, key in (one, 1), (other, 2):
        udp.send(osc("/frame/start", key))
    for udp, key in (one, 1), (other, 2):
        udp.send(pose(key))
        udp.send(osc("/frame/end", key))
    frames = [heard.next(), heard.next()]
    assert [(f.frame, f.bodies[0].id) for f in frames] == [(1, 1), (2, 2)]
    assert frames[0].source != frames[1].source


@pytest.mark.parametrize(
    "garbage",
    [
        b"",
        b"x",
        b"garbage!",
        random.Random(1).randbytes(1_400),
        b"#bundle\0" + bytes(8) + b"\xff\xff\xff\xfc",
        b"#bundle\0" * 500,
        osc("/rigidbody/1/position", 1.0),
        bytes(65_000),
    ],
)
def test_good_frame_after_garbage(receiver, heard, telemetry, sockets, garbage):
    udp = sender(sockets, receiver)
    udp.send(garbage)
    udp.send(frame(7, 1))
    assert heard.next().frame == 7
    assert telemetry.counts()["frames_dropped"] == {"malformed": 1}


def test_a_stream_passes_through_another_senders_flood(receiver, heard, telemetry, sockets):
    good, bad = sender(sockets, receiver), sender(sockets, receiver)
    for n in range(200):
        good.send(frame(n, 1))
        for _ in range(10):
            bad.send(b"garbage!")
        assert heard.next().frame == n
    good.send(frame(200, 1))
    assert heard.next().frame == 200
    dropped = telemetry.counts()["frames_dropped"]
    assert dropped["malformed"] >= FAULTS_PER_S
    assert dropped["malformed"] + dropped["rate"] <= 2_000


def test_senders_that_come_and_go_do_not_pile_up(receiver, heard, sockets):
    for n in range(3 * MAX_SENDERS):
        sender(sockets, receiver).send(frame(n, 1))
        assert heard.next().frame == n
    assert len(receiver._assemblers) == MAX_SENDERS


def test_only_allowed_addresses_may_send(heard, telemetry, sockets):
    allow = [ipaddress.ip_network("127.0.0.2/32")]
    receiver = OscBodies(OSC.intake(heard, telemetry), port=0, allow=allow)
    receiver.start()
    stranger, friend = sender(sockets, receiver), sender(sockets, receiver)
    stranger.send(frame(1, 1))
    friend.close()
    friend = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sockets.append(friend)
    friend.bind(("127.0.0.2", 0))
    friend.connect(("127.0.0.1", int(receiver.address.rpartition(":")[2])))
    friend.send(frame(2, 1))
    assert heard.next().frame == 2
    receiver.stop()
    assert telemetry.counts()["frames_dropped"] == {"not_allowed": 1}


def test_a_frame_that_lost_its_time_is_counted(receiver, heard, telemetry, sockets):
    udp = sender(sockets, receiver)
    udp.send(bundle(osc("/frame/timestamp", 1_000.0), pose(1)))
    udp.send(bundle(pose(1), pose(2)))
    udp.send(bundle(osc("/frame/timestamp", 2_000.0), pose(1)))
    assert [heard.next().t_s for _ in range(2)] == [1.0, 2.0]
    assert telemetry.counts()["frames_dropped"] == {"incomplete": 1}


def test_ipv6(heard, telemetry, sockets):
    receiver = OscBodies(OSC.intake(heard, telemetry), host="::1", port=0)
    receiver.start()
    udp = socket.socket(socket.AF_INET6, socket.SOCK_DGRAM)
    sockets.append(udp)
    udp.sendto(frame(3, 1), ("::1", int(receiver.address.rpartition(":")[2])))
    assert heard.next().frame == 3
    receiver.stop()
