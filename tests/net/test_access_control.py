"""Access control of a socket: too many connections, and messages without end, do not affect the other clients."""

import select
import socket
import struct
from contextlib import ExitStack

import msgpack
import pytest
import zmq

from manipnet.inputs.zeromq import ZEROMQ
from manipnet.inputs.zeromq.receiver import ZmqBodies
from manipnet.net import access_control as access
from manipnet.net.access_control import AccessControl
from manipnet.net.connection_limits import MAX_UNDELIVERED_BYTES, MOST_WAITING, SMALL_TALK_BYTES, Connections
from manipnet.net.zmq_socket import MAX_WIRE_BYTES
from manipnet.telemetry import Telemetry

MOST = 3
MESSAGE = msgpack.packb({"t": 1.0, "bodies": [{"id": 1, "p": [0, 0, 0], "q": [0, 0, 0, 1]}]})


class Door:
    """A publisher that allows `MOST` connections."""

    def __init__(self) -> None:
        self.telemetry, self.context = Telemetry(), zmq.Context()
        self.pub = self.context.socket(zmq.XPUB)  # which tells when a subscription has come
        self.pub.setsockopt(zmq.LINGER, 0)
        self.pub.setsockopt(zmq.XPUB_VERBOSE, 1)
        self.keeper = AccessControl(self.context, self.pub, self.telemetry, most=MOST)
        self.pub.bind("tcp://127.0.0.1:0")
        self.address = self.pub.getsockopt_string(zmq.LAST_ENDPOINT)

    def refused(self) -> dict[str, int]:
        return self.telemetry.counts().get("connections_refused", {})

    def close(self) -> None:
        self.pub.close()
        self.context.term()
        self.keeper.join()


@pytest.fixture
def door():
    door = Door()
    yield door
    door.close()


def subscribe(context, door):
    """A subscriber that is connected."""
    sub = context.socket(zmq.SUB)
    sub.setsockopt(zmq.LINGER, 0)
    sub.subscribe(b"")
    sub.connect(door.address)
    for _ in range(2_000):
        if door.pub.poll(10):
            door.pub.recv()
            return sub
        sub.poll(0)  # a subscriber that was refused subscribes again only when it is used
    pytest.fail("no subscription came")


def knock(address: str) -> socket.socket:
    host, _, port = address.removeprefix("tcp://").rpartition(":")
    return socket.create_connection((host, int(port)), 20)


def speak_zmtp(address: str, kind: bytes) -> socket.socket:
    """A connection that has completed the handshake of ZMTP 3.1 as a socket of `kind`."""
    tcp = knock(address)
    tcp.sendall(b"\xff" + bytes(8) + b"\x7f\x03\x01NULL" + bytes(16) + bytes(32))
    ready = b"\x05READY\x0bSocket-Type" + struct.pack(">I", len(kind)) + kind
    tcp.sendall(b"\x04" + bytes([len(ready)]) + ready)
    return tcp


def is_cut_off(tcp: socket.socket, while_sending: bytes = b"") -> bool:
    """Whether the other side ends the connection while we keep sending the same bytes."""
    tcp.setblocking(False)
    rest = memoryview(while_sending)
    try:
        while True:
            readable, writable, _ = select.select([tcp], [tcp] if while_sending else [], [], 20)
            if readable and not tcp.recv(65_536):
                return True
            if writable:
                rest = rest[tcp.send(rest) :] or memoryview(while_sending)
            elif not readable:
                return False
    except ConnectionError:
        return True


def test_one_connection_too_many_is_refused_and_counted_and_accepted_when_there_is_room(door):
    with zmq.Context() as context, ExitStack() as crowd:
        subs = [crowd.enter_context(subscribe(context, door)) for _ in range(MOST)]
        with speak_zmtp(door.address, b"SUB") as late:
            assert is_cut_off(late)
        assert door.refused()["too_many"] == 1
        assert len(door.keeper.connections) == MOST
        door.pub.send(b"news")
        assert [sub.recv() for sub in subs] == [b"news"] * MOST
        subs.pop().close()
        crowd.enter_context(subscribe(context, door))


def test_a_client_that_does_not_speak_zeromq_is_counted(monkeypatch):
    monkeypatch.setattr(access, "HANDSHAKE_MS", 200)
    door = Door()
    with zmq.Context() as context, subscribe(context, door), knock(door.address) as browser:
        browser.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
        for _ in range(2_000):
            if door.refused():
                break
            door.pub.poll(10)
        assert door.refused() == {"handshake": 1}
    door.close()


@pytest.mark.skipif(not hasattr(socket, "TCP_INFO"), reason="only Linux tells how much came over a connection")
def test_frames_without_end_cost_a_subscriber_its_connection(door):
    frame = b"\x03" + struct.pack(">Q", 1 << 17) + bytes(1 << 17)
    with zmq.Context() as context, subscribe(context, door) as good, speak_zmtp(door.address, b"SUB") as bad:
        assert is_cut_off(bad, while_sending=frame)
        door.pub.send(b"news")
        assert good.recv() == b"news"


@pytest.mark.skipif(not hasattr(socket, "TCP_INFO"), reason="only Linux tells how much came over a connection")
def test_frames_without_end_cost_only_their_sender_the_connection(heard, telemetry):
    receiver = ZmqBodies(ZEROMQ.intake(heard, telemetry), port=0)
    receiver.start()
    frame = b"\x03" + struct.pack(">Q", MAX_WIRE_BYTES) + bytes(MAX_WIRE_BYTES)
    with zmq.Context() as context, context.socket(zmq.XPUB) as good, speak_zmtp(receiver.address, b"PUB") as bad:
        good.setsockopt(zmq.LINGER, 0)
        good.connect(receiver.address)
        assert good.poll(20_000)
        assert is_cut_off(bad, while_sending=frame)
        good.send(MESSAGE)
        assert heard.next().t_s == 1.0
    receiver.stop()
    assert telemetry.counts()["connections_refused"] == {"endless": 1}


@pytest.fixture
def pair():
    """A connection to a port, and the port."""
    with socket.create_server(("127.0.0.1", 0)) as server, socket.create_connection(server.getsockname()) as client:
        accepted, _ = server.accept()
        with accepted:
            yield client, accepted, server.getsockname()[1]


def test_messages_that_are_read_may_go_on_without_end(pair):
    client, accepted, port = pair
    refused: list[str] = []
    connections = Connections(MOST, refused.append)
    connections.listening(port)
    connections.opened(accepted.fileno())
    for _ in range(3 * MAX_UNDELIVERED_BYTES // 65_536):
        client.sendall(bytes(65_536))
        accepted.recv(65_536, socket.MSG_WAITALL)
        connections.delivered(accepted.fileno())
        connections.look()
    for _ in range(100):
        client.sendall(bytes(SMALL_TALK_BYTES))
        connections.look()
    assert refused == []


def test_a_descriptor_that_was_reused_is_not_touched(pair):
    client, _, port = pair
    refused: list[str] = []
    connections = Connections(0, refused.append)
    connections.listening(port)
    with socket.create_server(("127.0.0.1", 0)) as other, open(__file__) as file:
        for descriptor in (other.fileno(), file.fileno(), 10_000):
            connections.opened(descriptor)
        connections.look()
        for descriptor in (other.fileno(), file.fileno(), 10_000):
            connections.closed(descriptor)
    client.sendall(b"still there")
    assert refused == ["handshake"] * 3


class Crowd:
    """Connections to a port, in the order in which they were accepted, and what becomes of them."""

    def __init__(self, most: int = MOST) -> None:
        self.refused: list[str] = []
        self.now_s = 0.0
        self.connections = Connections(most, self.refused.append, clock=lambda: self.now_s)
        self._server = socket.create_server(("127.0.0.1", 0), backlog=1_000)
        self.connections.listening(self._server.getsockname()[1])
        self._accepted: list[socket.socket] = []
        self._clients: list[socket.socket] = []

    def enter(self, content: bytes = b"", source: str = "127.0.0.1") -> socket.socket:
        """A connection that is accepted and has sent `content`."""
        client = socket.create_connection(self._server.getsockname(), 20, (source, 0))
        client.sendall(content)
        accepted, _ = self._server.accept()
        if content:
            accepted.recv(len(content), socket.MSG_PEEK | socket.MSG_WAITALL)
        self._accepted.append(accepted)
        self._clients.append(client)
        self.now_s += 1e-3
        self.connections.opened(accepted.fileno())
        return client

    def close(self) -> None:
        for each in (*self._accepted, *self._clients, self._server):
            each.close()


@pytest.fixture
def crowd():
    crowd = Crowd()
    yield crowd
    crowd.close()


def is_open(client: socket.socket) -> bool:
    client.setblocking(False)
    try:
        return client.recv(1) != b""
    except BlockingIOError:
        return True
    except ConnectionError:
        return False


linux = pytest.mark.skipif(not hasattr(socket, "TCP_INFO"), reason="only Linux tells how far a connection has got")
GREETING, HANDSHAKE = b"g" * 64, b"h" * 200


@linux
def test_those_that_have_got_least_far_lose_their_place_in_the_handshake_first(crowd):
    listed = crowd.enter(HANDSHAKE)
    greeted = [crowd.enter(GREETING) for _ in range(MOST_WAITING - 10)]
    silent = [crowd.enter() for _ in range(MOST_WAITING)]
    crowd.now_s += 1.0
    crowd.connections.look()
    assert is_open(listed)
    assert all(map(is_open, greeted))
    assert sum(map(is_open, silent)) == 9
    assert all(map(is_open, silent[-9:])), "the newest are kept"


@linux
def test_a_crowd_from_one_address_does_not_cost_another_address_its_place(crowd):
    lonely = crowd.enter(source="127.0.0.2")
    for _ in range(3 * MOST_WAITING):
        crowd.enter(GREETING)
    assert is_open(lonely)
    assert set(crowd.refused) == {"too_many"}


@linux
def test_admitted_connections_are_not_cut_by_a_crowd(crowd):
    clients = [crowd.enter(HANDSHAKE) for _ in range(MOST)]
    for _ in clients:
        crowd.connections.succeeded()
    crowd.connections.look()
    assert len(crowd.connections) == MOST
    for _ in range(5 * MOST_WAITING):
        crowd.enter(HANDSHAKE)
    assert all(map(is_open, clients))


@linux
def test_a_newcomer_is_not_cut_before_the_others(crowd):
    for _ in range(MOST_WAITING):
        crowd.enter(GREETING)
    crowd.now_s += 1.0
    newcomer = crowd.enter()
    crowd.connections.look()
    assert is_open(newcomer)


def test_old_peers_are_refused_and_counted_while_others_may_connect(door):
    with zmq.Context() as context, knock(door.address) as old:
        old.sendall(b"\x01\x00\x03\x00hi")
        assert is_cut_off(old)
        for _ in range(2_000):
            if door.refused():
                break
            door.pub.poll(10)
        assert door.refused() == {"handshake": 1}
        subscribe(context, door).close()
