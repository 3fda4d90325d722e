"""Peers of ZMTP 1.0 and 2.0, and whatever else reaches a ZeroMQ port: refused, and nothing ends or spins."""

import os
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from live_server import LiveServer, Sender, Subscriber, scene, serving

PORTS = ("hands", "bodies", "control")
ZMTP_1 = b"\x01\x00" + bytes([26, 0]) + b"x" * 25
"""An empty identity and one frame of 25 bytes, as a ZeroMQ 2 peer sends them."""
ZMTP_2 = b"\xff\x00\x00\x00\x00\x00\x00\x00\x01\x7f\x01\x01" + b"\x00\x00" + b"\x00\x05hello"
"""Signature, revision 1, socket type PUB, an empty identity and one frame."""
FETCH = b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: text/plain\r\nContent-Length: 600\r\n\r\n" + b"\x01" * 600
"""What a web page sends with `fetch`: the letters of the header read as lengths and flags of ZMTP 1.0."""
POSE = b'{"t": 1e6, "bodies": [{"name": "Box", "p": [9, 9, 9], "q": [0, 0, 0, 1]}]}'
ZMTP_1_POSE = b"\x01\x00" + bytes([len(POSE) + 1, 0]) + POSE
"""A message that would pose a body if such peers were merely tolerated."""
ZMTP_1_REQUEST = b"\x01\x00" + b"\x01\x01" + b'\x0e\x00{"op":"rest"}'
"""A request that would be met if such peers were merely tolerated."""
OLD = {"1.0": ZMTP_1, "2.0": ZMTP_2, "fetch": FETCH, "1.0 with a pose": ZMTP_1_POSE, "1.0 request": ZMTP_1_REQUEST}


@pytest.fixture(scope="module")
def server(tiny_bundle: Path) -> Iterator[LiveServer]:
    with serving("--mesh", "Box=cube", "--model", str(tiny_bundle)) as server:
        yield server


def say(address: str, content: bytes) -> bytes:
    """Everything a port answers to `content` until it closes the connection."""
    split = urlsplit(address)
    assert split.hostname is not None
    with socket.create_connection((split.hostname, split.port or 0), timeout=30.0) as connection:
        connection.sendall(content)
        answer = b""
        try:
            while part := connection.recv(4096):
                answer += part
        except ConnectionError:
            pass
        return answer


def assert_serves(server: LiveServer, start_s: float) -> None:
    """Bodies of a good sender become live hands, and a request is answered."""
    subscriber, sender = Subscriber(server.addresses["hands"]), Sender(server.addresses["bodies"])
    try:
        begin_s = time.monotonic()
        for i in range(180):
            time.sleep(max(begin_s + i / 120.0 - time.monotonic(), 0.0))
            sender.send(start_s + i / 120.0, scene(i / 120.0))
        message = subscriber.until(start_s + 0.9)[-1]
        assert message.hands["left"].state == "live"
        assert all(abs(value) < 3.0 for body in message.bodies for value in body.pose[:3])
    finally:
        sender.close()
        subscriber.close()
    assert "counters" in server.ask({"op": "status"})


@pytest.mark.parametrize("name", OLD)
@pytest.mark.parametrize("port", PORTS)
def test_an_old_peer_is_refused_before_it_says_anything(server: LiveServer, port: str, name: str) -> None:
    before = server.ask({"op": "status"})["counters"]
    for _ in range(3):
        say(server.addresses[port], OLD[name])
    after = server.ask({"op": "status"})["counters"]
    assert after.get("frames_in") == before.get("frames_in")
    assert "rest" not in after.get("control_requests", {})


def test_a_good_sender_client_and_request_work_afterwards(server: LiveServer) -> None:
    for port in PORTS:
        for content in OLD.values():
            say(server.addresses[port], content)
    assert_serves(server, 5000.0)


def test_no_thread_spins_afterwards(server: LiveServer) -> None:
    for content in OLD.values():
        say(server.addresses["control"], content)
    spent = [cpu_s(server.process.pid)]
    time.sleep(1.0)  # the length of the measurement, nothing is waited for
    spent.append(cpu_s(server.process.pid))
    assert spent[1] - spent[0] < 0.7


def test_whoever_is_refused_is_counted(server: LiveServer) -> None:
    before = server.ask({"op": "status"})["counters"].get("connections_refused", {})
    say(server.addresses["bodies"], ZMTP_1)
    give_up_s = time.monotonic() + 60.0
    while server.ask({"op": "status"})["counters"].get("connections_refused", {}) == before:
        assert time.monotonic() < give_up_s, "an old peer was not counted"


def cpu_s(process: int) -> float:
    """Processor time of a process so far, seconds."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
