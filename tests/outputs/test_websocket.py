"""Hands over WebSocket: every payload arrives, slow clients get the newest, pages of other sites are refused."""

import json
import os
import socket
import time
from contextlib import ExitStack

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from manipnet.common.options import ConfigError
from manipnet.net.half_open import MOST_HALF_OPEN
from manipnet.outputs.websocket.client import MAX_REQUESTS, MINUTE_S, Client, avatar_of
from manipnet.outputs.websocket.server import MAX_CLIENTS, WebSocketPublisher
from manipnet.outputs.websocket.token import read_token
from manipnet.telemetry import Telemetry


@pytest.fixture
def telemetry():
    return Telemetry()


@pytest.fixture
def publisher(telemetry):
    publisher = WebSocketPublisher(telemetry, "127.0.0.1", 0)
    yield publisher
    publisher.close()


def receive(publisher, connection, payload):
    """Publish a payload until the client, whose connection is not announced, has received it."""
    while True:
        publisher.publish(payload)
        try:
            return connection.recv(timeout=0.1)
        except TimeoutError:
            continue


def wait_until(is_so):
    give_up_s = time.monotonic() + 20.0
    while not is_so():
        assert time.monotonic() < give_up_s
        time.sleep(0.01)


def test_payloads_arrive_in_order(publisher):
    with connect(publisher.address) as connection:
        assert receive(publisher, connection, b"0") == b"0"
        for payload in (b"1", b"2", b"3"):
            publisher.publish(payload)
            while (got := connection.recv(timeout=10)) == b"0":
                pass
            assert got == payload


def test_a_slow_client_gets_the_newest(publisher):
    with connect(publisher.address, max_queue=1) as connection:
        receive(publisher, connection, b"start")
        for i in range(3000):
            publisher.publish(i.to_bytes(4, "big") * 1000)
        seen = []
        while not seen or seen[-1] < 2999:
            payload = connection.recv(timeout=10, decode=False)
            if payload != b"start":
                seen.append(int.from_bytes(payload[:4], "big"))
    assert seen == sorted(set(seen))
    assert len(seen) < 3000


@pytest.mark.parametrize("origin", ["http://localhost:8000", "http://127.0.0.1", "https://[::1]:8443"])
def test_local_pages_may_connect(publisher, origin):
    with connect(publisher.address, origin=origin) as connection:
        assert receive(publisher, connection, b"x") == b"x"


@pytest.mark.parametrize("origin", ["https://example.com", "null", "http://localhost.example.com"])
def test_other_pages_may_not(publisher, origin):
    with pytest.raises(InvalidStatus, match="403"):
        connect(publisher.address, origin=origin)


def test_a_refused_page_leaves_one_line_in_the_log(publisher, caplog):
    for _ in range(2):  # the line of the first one is written when the second one is answered
        with pytest.raises(InvalidStatus, match="403"):
            connect(publisher.address, origin=Origin("https://example.com"))
    record = next(record for record in caplog.records if record.name.startswith("manipnet"))
    assert record.getMessage() == "refused a connection: invalid Origin header: https://example.com"
    assert record.exc_info is None


@pytest.mark.slow
def test_a_client_comes_in_while_a_crowd_says_nothing(publisher, telemetry):
    host, port = publisher.address.removeprefix("ws://").split(":")
    with ExitStack() as crowd:
        for _ in range(3 * MOST_HALF_OPEN):
            crowd.enter_context(socket.create_connection((host, int(port)), 20))
        with connect(publisher.address) as connection:
            assert receive(publisher, connection, b"x") == b"x"
    assert telemetry.counts()["connections_refused"]["too_many"] >= MOST_HALF_OPEN


def test_the_number_of_clients_is_limited_and_refusals_are_counted(publisher, telemetry):
    with ExitStack() as crowd:
        for _ in range(MAX_CLIENTS):
            receive(publisher, crowd.enter_context(connect(publisher.address, max_queue=None)), b"x")
        with connect(publisher.address) as late, pytest.raises(ConnectionClosed, match="at most 32 clients"):
            late.recv(timeout=10)
        assert publisher.connected() == MAX_CLIENTS
    assert telemetry.counts() == {"connections_refused": {"too_many": 1}}


def test_a_client_that_keeps_sending_is_cut_off(publisher, telemetry):
    with connect(publisher.address) as connection:
        connection.send("x" * 70_000)
        with pytest.raises(ConnectionClosed, match="1009"):
            connection.recv(timeout=10)
    with connect(publisher.address) as connection:
        for _ in range(MAX_REQUESTS):
            connection.send("x")
            assert "must be a text message with a JSON map" in json.loads(connection.recv(timeout=10))["error"]
        connection.send("x")
        with pytest.raises(ConnectionClosed, match="at most 16 requests a minute"):
            connection.recv(timeout=10)
    assert telemetry.counts() == {"connections_refused": {"endless": 1}}


def test_a_client_at_the_path_of_an_avatar_receives_only_its_hands(publisher):
    with connect(f"{publisher.address}/hand/long") as avatar, connect(publisher.address) as model:
        wait_until(lambda: publisher.connected() == 2)
        assert publisher.wants("long")
        assert not publisher.wants("other")
        for payload, name in ((b"model", None), (b"other", "other"), (b"avatar", "long"), (b"model again", None)):
            publisher.publish(payload, name)
        assert avatar.recv(timeout=10) == b"avatar"
        assert [model.recv(timeout=10) for _ in range(2)] == [b"model", b"model again"]
        with pytest.raises(TimeoutError):
            avatar.recv(timeout=0.1)
    wait_until(lambda: not publisher.wants("long"))


@pytest.mark.parametrize(
    ("path", "name"),
    [
        ("/", None),
        ("/anything/hand/x", None),
        ("//[", None),
        ("/hand/long?x=1", "long"),
        ("/hand/h%C3%A4nde", "hände"),
        ("/hand/a%2Fb", "a/b"),
        ("/hand/%FF", "\ufffd"),
    ],
)
def test_the_path_names_the_avatar(path, name):
    assert avatar_of(path) == name


def test_a_path_without_a_name_is_refused(publisher):
    with pytest.raises(InvalidStatus, match="404"):
        connect(f"{publisher.address}/hand/")


def test_a_client_may_send_requests_again_after_a_minute():
    client = Client(None)
    assert all(client.may_ask(0.0) for _ in range(MAX_REQUESTS))
    assert not client.may_ask(MINUTE_S - 1.0)
    client = Client(None)
    assert all(client.may_ask(10.0 * n) for n in range(100))


def test_a_port_in_use_is_an_error(publisher):
    port = int(publisher.address.rpartition(":")[2])
    with pytest.raises(OSError, match="in use"):
        WebSocketPublisher(Telemetry(), "127.0.0.1", port)


def test_close_twice_and_publish_after():
    publisher = WebSocketPublisher(Telemetry(), "127.0.0.1", 0)
    publisher.close()
    publisher.close()
    publisher.publish(b"nobody hears this")
    assert publisher.address is not None
    host, port = publisher.address.removeprefix("ws://").split(":")
    with pytest.raises(OSError):
        socket.create_connection((host, int(port)), 5)


TOKEN = "a-token-of-the-stage_2026"


@pytest.fixture
def guarded(telemetry):
    publisher = WebSocketPublisher(telemetry, "127.0.0.1", 0, TOKEN)
    yield publisher
    publisher.close()


def offering(token):
    return [Subprotocol("manipnet"), Subprotocol(f"manipnet.token.{token}")]


@pytest.mark.parametrize("origin", [None, "http://localhost:8000", "https://headset.example"])
def test_with_a_token_every_page_may_connect_that_shows_it(guarded, origin):
    with connect(guarded.address, origin=origin, subprotocols=offering(TOKEN)) as connection:
        assert connection.subprotocol == "manipnet"
        assert receive(guarded, connection, b"x") == b"x"


@pytest.mark.parametrize("offered", [None, [Subprotocol("manipnet")], offering("wrong"), offering(TOKEN[:-1])])
@pytest.mark.parametrize("origin", [None, "http://localhost:8000"])
def test_with_a_token_nobody_connects_without_it(guarded, telemetry, offered, origin):
    with pytest.raises(InvalidStatus, match="401"):
        connect(guarded.address, origin=origin, subprotocols=offered)
    assert telemetry.counts() == {"connections_refused": {"token": 1}}


def test_a_token_is_read_from_a_private_file(tmp_path):
    path = tmp_path / "token"
    path.write_text(TOKEN + "\n")
    path.chmod(0o600)
    assert read_token(path) == TOKEN
    path.chmod(0o644)
    if os.name == "posix":
        with pytest.raises(ConfigError, match=f"chmod 600 {path}"):
            read_token(path)
    path.chmod(0o600)
    for text in ("short", "spaces are not allowed in a token", ""):
        path.write_text(text)
        with pytest.raises(ConfigError, match="20 to 200 letters"):
            read_token(path)
    with pytest.raises(ConfigError, match="cannot read the token"):
        read_token(tmp_path / "missing")
