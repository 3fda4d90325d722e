"""The NatNet client against a fake Motive, over real sockets on loopback."""

import ipaddress
import itertools
import logging
import queue
import socket
import time

import natnet_capture
import pytest
from fake_motive import CLOCK_HZ, FakeMotive
from natnet_writer import Body, Frame, packet, server_info

from manipnet.inputs.natnet import NATNET
from manipnet.inputs.natnet import client as natnet_client
from manipnet.inputs.natnet.client import NatNetBodies
from manipnet.inputs.natnet.definitions import Definitions
from manipnet.inputs.natnet.frames import read_frame
from manipnet.inputs.natnet.names import Names
from manipnet.inputs.natnet.options import COMMAND_PORT, NatNetOptions
from manipnet.net.errors import ListenError

VERSIONS = [(2, 7), (2, 8), (2, 9), (2, 10), (3, 0), (3, 1), (4, 0), (4, 1), (4, 2), (4, 3), (4, 4), (4, 5)]
Q = (0.0, 0.6, 0.0, 0.8)


def client_of(heard, telemetry, host, port=COMMAND_PORT, allow=(), **options):
    """A client of the server at `host:port`."""
    return NatNetBodies(NATNET.intake(heard, telemetry), NatNetOptions((host, port), **options), allow)


@pytest.fixture(autouse=True)
def _hurry(monkeypatch):
    """What the client does every second, it does ten times as often here."""
    for period in ("CONNECT_S", "KEEP_ALIVE_S", "ECHO_S"):
        monkeypatch.setattr(natnet_client, period, 0.1)


@pytest.fixture
def connect(heard, telemetry):
    clients = []

    def connect(motive, **options):
        allow = options.pop("allow", ())
        client = client_of(heard, telemetry, "127.0.0.1", motive.port, allow, **options)
        clients.append(client)
        client.start()
        motive.wait_for(0)
        return client

    yield connect
    for client in clients:
        client.stop()


@pytest.fixture
def warnings():
    """The warnings of the client, which come once a problem is in its status."""
    warnings = queue.Queue()
    log, handler = logging.getLogger(natnet_client.__name__), logging.Handler(logging.WARNING)
    handler.emit = lambda record: warnings.put(record.getMessage())
    log.addHandler(handler)
    yield warnings
    log.removeHandler(handler)


def write(version, number=1, **options):
    return Frame(number=number, **options).write(version)


def test_the_capture_arrives_value_by_value(connect, heard):
    datagrams = list(natnet_capture.datagrams())
    answers = {d.data[0]: d.data[4:] for d in datagrams}
    with FakeMotive(info=answers[1], models=answers[5]) as motive:
        connect(motive)
        motive.wait_for(12)  # the echo request follows the definitions
        for payload in natnet_capture.frames():
            expected = read_frame(payload, (3, 0))
            motive.send(payload)
            frame = heard.next()
            assert (frame.frame, frame.t_s) == (expected.number, expected.timestamp_s)
            (body,) = frame.bodies
            assert (body.id, body.name, body.tracked) == (2, "RaceQuad", True)
            assert body.p == expected.bodies[0].p
            assert body.q == pytest.approx(expected.bodies[0].q, abs=1e-6)


@pytest.mark.parametrize("version", VERSIONS, ids=lambda v: f"{v[0]}.{v[1]}")
def test_every_version_by_the_servers_answer(connect, heard, version):
    with FakeMotive(version, {1: "left wrist", 3: "Box"}) as motive:
        client = connect(motive)
        motive.wait_for(12)
        motive.send(write(version, bodies=[Body(1, (1, 2, 3), Q), Body(3, params=0), Body(9)]))
        frame = heard.next()
        assert [(b.id, b.name, b.tracked) for b in frame.bodies] == [
            (1, "left wrist", True),
            (3, "Box", False),
            (9, None, True),
        ]
        assert frame.bodies[0].p == (1.0, 2.0, 3.0)
        assert frame.bodies[0].q == pytest.approx(Q, abs=1e-6)
        assert frame.t_s == 12.5
        assert frame.source.startswith("natnet:127.0.0.1:")
        assert client.status()["state"] == "streaming"
        assert client.status()["server"] == f"Motive, NatNet {version[0]}.{version[1]}"


def test_z_up_becomes_y_up(connect, heard):
    with FakeMotive() as motive:
        connect(motive, up="z")
        motive.wait_for(4)
        motive.send(write((3, 0), bodies=[Body(1, (1, 2, 3), (0.1, 0.2, 0.3, 0.9273618))]))
        (body,) = heard.next().bodies
        assert body.p == (1.0, 3.0, -2.0)
        assert body.q == pytest.approx((0.1, 0.3, -0.2, 0.9273618), abs=1e-6)


def stream_until_named(motive, heard, name):
    """Send frames until the definitions, which are sent separately, have reached the client."""
    for number in itertools.count():
        motive.send(write(motive.version, number))
        frame = heard.next()
        assert frame.frame == number
        if frame.bodies[0].name == name:
            return


def test_names_are_requested_again_when_a_frame_asks_for_it(connect, heard):
    with FakeMotive(names={1: "old"}) as motive:
        connect(motive)
        motive.wait_for(12)
        motive.send(write((3, 0)))
        assert heard.next().bodies[0].name == "old"
        motive.names = {1: "new"}
        motive.send(write((3, 0), flags=2))
        heard.next()
        motive.wait_for(4, 2)
        stream_until_named(motive, heard, "new")


def test_names_are_requested_at_once_for_an_id_that_nobody_has_named(connect, heard):
    with FakeMotive(names={1: "left_wrist", 2: "Box"}) as motive:
        connect(motive)
        stream_until_named(motive, heard, "left_wrist")
        motive.names = {1: "left_wrist", 7: "Box"}
        for number in itertools.count(1000):
            motive.send(write((3, 0), number, bodies=[Body(1), Body(7)]))
            if heard.next().bodies[1].name == "Box":
                return


def test_an_id_that_the_server_does_not_name_is_asked_for_ever_less_often():
    names, frame = Names(), read_frame(write((3, 0), full=False), (3, 0))
    asked = []
    for tenth in range(6_000):
        names.note(frame)
        if names.should_ask(0.1 * tenth, 1.0):
            asked.append(0.1 * tenth)
            names.define(Definitions())
    assert asked[:3] == pytest.approx([0.0, 2.0, 6.0])
    assert 20 < len(asked) < 30


def test_two_bodies_with_one_id_are_refused_and_named(connect, heard, warnings):
    with FakeMotive(names=[(1, "left_wrist"), (3, "Box"), (3, "Stick")]) as motive:
        client = connect(motive)
        assert "'Box' and 'Stick' have the streaming id 3" in warnings.get(timeout=20)
        motive.send(write((3, 0), bodies=[Body(1), Body(3), Body(3, (2, 1, 2))]))
        bodies = heard.next().bodies
        assert [(body.id, body.name, body.tracked, body.fault) for body in bodies] == [
            (1, "left_wrist", True, None),
            (3, None, False, "conflict"),
        ]
        assert "'Box' and 'Stick'" in client.status()["conflicts"][0]


def test_an_id_that_occurs_twice_only_in_the_frames_is_named_too(connect, heard, warnings):
    with FakeMotive(names={3: "Box"}) as motive:
        connect(motive)
        motive.wait_for(12)
        motive.send(write((3, 0), bodies=[Body(3), Body(3, (2, 1, 2))]))
        assert heard.next().bodies[0].fault == "conflict"
        assert "the streaming id 3 occurs twice in each frame" in warnings.get(timeout=20)


def test_a_name_that_occurs_twice_is_no_name(connect, heard, warnings):
    with FakeMotive(names=[(1, "Box"), (2, "Box")]) as motive:
        connect(motive)
        assert "the streaming ids 1 and 2 have the name 'Box'" in warnings.get(timeout=20)
        motive.send(write((3, 0)))
        assert [(body.id, body.name) for body in heard.next().bodies] == [(1, None), (2, None)]


@pytest.mark.parametrize("version", [(2, 10), (3, 1), (4, 2)])
def test_bones_of_skeletons_are_bodies_by_name(connect, heard, version):
    with FakeMotive(version, {1: "Box"}) as motive:
        motive.skeletons = {5: ("Ann", {9: "Ann_LHand", 13: "RHand"}), 6: ("Bob", {9: "LHand"})}
        client = connect(motive)
        motive.wait_for(12)
        hands = {5: [Body(5 << 16 | 9, (1, 2, 3)), Body(5 << 16 | 13, params=0)], 6: [Body(9)], 7: [Body(1)]}
        motive.send(write(version, bodies=[Body(1)], skeletons=hands))
        bodies = heard.next().bodies
        assert [(body.id, body.name, body.tracked) for body in bodies] == [
            (1, "Box", True),
            (None, "Ann:LHand", True),
            (None, "Ann:RHand", False),
            (None, "Bob:LHand", True),
        ]
        assert bodies[1].p == (1.0, 2.0, 3.0)
        status = client.status()
        assert status["bones"] == ["Ann:LHand", "Ann:RHand", "Bob:LHand"]
        assert status["unused"]["bones without a name"] == 1
        assert status["unused"]["labelled markers"] == 6


def test_a_name_in_another_encoding_is_shown_and_matched(heard, telemetry):
    with FakeMotive(names={1: "Würfel".encode("cp1252"), 2: "手".encode("shift_jis")}) as motive:
        client = NatNetBodies(
            NATNET.intake(heard, telemetry), NatNetOptions(("127.0.0.1", motive.port)), bodies=frozenset({"手"})
        )
        client.start()
        motive.wait_for(12)
        motive.send(write((3, 0)))
        assert [body.name for body in heard.next().bodies] == ["Würfel", "手"]
        assert client.status()["bodies"] == {"1": "Würfel", "2": "手"}
        client.stop()


def test_timecode_and_its_rate_are_passed_on(connect, heard):
    with FakeMotive() as motive:
        connect(motive)
        motive.wait_for(4)
        for k in range(4 * 50):
            second, frame = divmod(k // 2, 25)
            motive.send(write((3, 0), k, timecode=0x0A_00_00_00 | second << 8 | frame, timestamp_s=k / 50))
        frames = [heard.next() for _ in range(4 * 50)]
        assert [frames[0].timecode, frames[53].timecode] == ["10:00:00:00", "10:00:01:01"]
        assert [frames[0].timecode_rate, frames[-1].timecode_rate] == [None, 25.0]


def test_a_frame_without_timecode_has_none(connect, heard):
    with FakeMotive() as motive:
        connect(motive)
        motive.wait_for(4)
        motive.send(write((3, 0), timecode=0))
        assert heard.next().timecode is None


def test_time_stamps_that_stand_still_give_way_to_the_arrivals(connect, heard):
    with FakeMotive() as motive:
        client = connect(motive)
        motive.wait_for(4)
        for k in range(60):
            motive.send(write((3, 0), k, timestamp_s=0.0))
            frame = heard.next()
            time.sleep(1 / 120)
        assert frame.t_s == pytest.approx(frame.t_received_s, abs=0.2)
        assert client.status()["clock"] == {"used": "arrival", "set_aside": {"time stamp": "stands still"}}


def test_the_clock_is_known_within_its_uncertainty(connect, heard):
    with FakeMotive() as motive:
        client = connect(motive)
        motive.wait_for(12)
        motive.send(write((3, 0)))  # behind the echo's answer
        heard.next()
        status = client.status()
        error_s = abs(status["clock_offset_s"] - motive.clock_offset_s)
        assert error_s <= status["clock_uncertainty_s"] + 1e-6


def test_the_client_is_kept_alive(connect):
    with FakeMotive() as motive:
        connect(motive)
        motive.wait_for(10, 2)


def test_a_server_that_comes_late_is_found(heard, telemetry):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as placeholder:
        placeholder.bind(("127.0.0.1", 0))
        port = placeholder.getsockname()[1]
        client = client_of(heard, telemetry, "127.0.0.1", port)
        client.start()
        assert placeholder.recv(1_000)[:2] == b"\0\0"
        assert client.status()["state"] == "connecting"
    with FakeMotive(port=port) as motive:
        motive.wait_for(4)
        motive.send(write((3, 0)))
        assert heard.next().frame == 1
        client.stop()


def test_a_server_that_restarts_with_another_version_is_followed(connect, heard, monkeypatch):
    monkeypatch.setattr(natnet_client, "SILENT_S", 0.2)
    with FakeMotive((3, 0)) as motive:
        connect(motive)
        motive.wait_for(4)
        motive.send(write((3, 0), 1))
        assert heard.next().frame == 1
        port = motive.port
    with FakeMotive((4, 2), port=port) as motive:
        motive.wait_for(0)  # the client may ask for names before it connects
        motive.wait_for(4, motive.requests.get(4, 0) + 1)
        motive.send(write((4, 2), 2))
        assert heard.next().frame == 2


def test_multicast(connect, heard):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with FakeMotive((4, 1), {1: "Box"}, group="239.255.42.99", data_port=port) as motive:
        client = connect(motive, multicast=True, interface="127.0.0.1")
        motive.wait_for(12)
        stream_until_named(motive, heard, "Box")
        assert 10 not in motive.requests  # no keep-alive needed
        assert client.status()["problem"] is None


@pytest.mark.parametrize(
    ("options", "info", "expected"),
    [
        ({}, server_info(group="239.255.42.99"), "start with --multicast, or choose Unicast"),
        ({}, server_info(version=(2, 6)), "speaks NatNet 2.6, and this program understands 2.7"),
        ({}, server_info(version=(5, 1)), "speaks NatNet 5.1, and this program understands 2.7"),
        ({"multicast": True}, server_info(group="10.0.0.1"), "cannot join multicast 10.0.0.1:1511"),
    ],
)
def test_a_problem_is_logged_once_with_its_remedy_and_stays_in_the_status(connect, warnings, options, info, expected):
    with FakeMotive(info=info) as motive:
        client = connect(motive, **options)
        assert expected in warnings.get(timeout=20)
        seen = set()
        for answers in range(2, 6):
            motive.wait_for(0, answers)
            seen.add(client.status()["problem"])
    assert len(seen) == 1
    assert expected in seen.pop()
    assert warnings.empty()


@pytest.mark.parametrize(
    ("garbage", "reason"),
    [
        (b"", "malformed"),
        (b"garbage", "malformed"),
        (packet(7, b""), "malformed"),
        (packet(7, b"\xff" * 500), "malformed"),
        (packet(1, b"short"), "malformed"),
        (packet(5, b"\xff" * 40), "malformed"),
        (packet(13, b""), "malformed"),
    ],
)
def test_good_frame_after_garbage(connect, heard, telemetry, garbage, reason):
    with FakeMotive() as motive:
        connect(motive)
        motive.wait_for(4)
        motive.send(write((3, 0), 1))
        assert heard.next().frame == 1
        for client in motive.clients:
            motive._data.sendto(garbage, client)
        motive.send(write((3, 0), 2))
        assert heard.next().frame == 2
    assert telemetry.counts()["frames_dropped"] == {reason: 1}


def test_other_packets_are_ignored(connect, heard, telemetry):
    with FakeMotive() as motive:
        connect(motive)
        motive.wait_for(4)
        for message_id in (3, 8, 100, 9_999):
            motive.send(b"whatever", message_id)
        motive.send(write((3, 0), 2))
        assert heard.next().frame == 2
    assert "frames_dropped" not in telemetry.counts()


def test_other_hosts_are_refused(connect, heard, telemetry):
    with FakeMotive() as motive, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        connect(motive)
        motive.wait_for(4)
        stranger.bind(("127.0.0.2", 0))
        for client in motive.clients:
            stranger.sendto(packet(7, write((3, 0), 666)), client)
        motive.send(write((3, 0), 1))
        assert heard.next().frame == 1
    assert telemetry.counts()["frames_dropped"] == {"not_allowed": 1}


def test_frames_may_come_from_listed_networks_but_answers_only_from_the_server(connect, heard, telemetry):
    with FakeMotive() as motive, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as second_card:
        client = connect(motive, allow=[ipaddress.ip_network("127.0.0.2/32")])
        motive.wait_for(12)
        motive.send(write((3, 0), 1))
        assert heard.next().frame == 1
        second_card.bind(("127.0.0.2", 0))
        for address in motive.clients:
            second_card.sendto(packet(1, server_info(version=(2, 9))), address)
            second_card.sendto(packet(7, write((3, 0), 2)), address)
        assert heard.next().frame == 2
        assert client.status()["server"] == "Motive, NatNet 3.0"
    assert "frames_dropped" not in telemetry.counts()


def test_the_capture_time_of_a_frame_is_known_on_our_clock(connect, heard):
    with FakeMotive() as motive:
        client = connect(motive)
        motive.wait_for(12)
        exposed_s = time.monotonic() + motive.clock_offset_s - 0.004
        motive.send(write((3, 0), timestamp_s=77.0, stamps=(int(exposed_s * CLOCK_HZ), 0, 0)))
        frame, status = heard.next(), client.status()
        captured_s = frame.t_s - status["capture_offset_s"]
        error_s = captured_s - (exposed_s - motive.clock_offset_s)
        assert abs(error_s) <= status["clock_uncertainty_s"] + 2 / CLOCK_HZ
        assert captured_s < frame.t_received_s


def test_frames_before_the_version_is_known_are_dropped(heard, telemetry):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as motive:
        motive.bind(("127.0.0.1", 0))
        client = client_of(heard, telemetry, *motive.getsockname())
        client.start()
        _, address = motive.recvfrom(1_000)
        motive.sendto(packet(7, write((3, 0), 1)), address)
        motive.sendto(packet(1, server_info()), address)
        motive.sendto(packet(7, write((3, 0), 2)), address)
        assert heard.next().frame == 2
        client.stop()
    assert telemetry.counts()["frames_dropped"] == {"unsupported": 1}


def test_a_bad_pose_of_one_body_does_not_affect_the_others(connect, heard):
    with FakeMotive() as motive:
        connect(motive)
        motive.wait_for(4)
        motive.send(write((3, 0), bodies=[Body(1, (float("nan"), 0, 0)), Body(2, q=(0, 0, 0, 0)), Body(3)]))
        assert [body.fault for body in heard.next().bodies] == ["nan", "zero_quaternion", None]


@pytest.mark.parametrize(
    ("host", "options", "expected"),
    [
        ("no-such-host.invalid", {}, "cannot find the NatNet server 'no-such-host.invalid'"),
        ("127.0.0.1", {"interface": "203.0.113.9"}, "203.0.113.9:0: Cannot assign requested address"),
    ],
)
def test_a_wrong_host_or_interface_is_named(heard, telemetry, host, options, expected):
    with pytest.raises(ListenError, match=expected):
        client_of(heard, telemetry, host, **options).start()


def test_stop_without_start(heard, telemetry):
    client_of(heard, telemetry, "127.0.0.1").stop()
