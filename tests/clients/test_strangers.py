"""Clients meet servers that send broken messages or another version, encrypt, speak another protocol or stay silent."""

import http.server
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
import zmq
from checkout import VECTORS
from languages import LiveClient
from publisher import message

from manipnet.wire import TOPIC_BIN, encode_binary

ZMTP_CLIENTS = ("python", "csharp", "gcc-sanitized")
BAD = [TOPIC_BIN + path.read_bytes() for path in sorted(VECTORS.glob("bad_*.bin")) if path.stat().st_size]


@pytest.fixture(params=ZMTP_CLIENTS)
def connecting(request, harness):
    """Starts a client of each kind at an address and kills it at the end."""
    started = []

    def start(address):
        started.append(LiveClient.start(harness(request.param), address))
        return started[-1]

    yield start
    for client in started:
        client.kill()


@contextmanager
def publisher(**options: int | bytes) -> Iterator[tuple[zmq.Socket, str]]:
    """A plain publisher socket that receives subscriptions as messages."""
    with zmq.Context() as context, context.socket(zmq.XPUB) as pub:
        pub.setsockopt(zmq.LINGER, 0)
        for name, value in options.items():
            pub.setsockopt(getattr(zmq, name), value)
        port = pub.bind_to_random_port("tcp://127.0.0.1")
        yield pub, f"tcp://127.0.0.1:{port}"


def test_good_frames_among_broken_ones(connecting):
    with publisher(RCVTIMEO=20_000) as (pub, address):
        client = connecting(address)
        assert pub.recv() == b"\x01" + TOPIC_BIN
        for k, bad in enumerate(BAD):
            pub.send(bad)
            pub.send_multipart([TOPIC_BIN + b"of many", b"parts"])
            pub.send(TOPIC_BIN + encode_binary(message(k, k / 60, 0.0)))
        figures = client.ask_until(lambda f: f["received"] == len(BAD))
        assert figures["refused"] == len(BAD)
        pub.send(next(bad for bad in BAD if bad[13] == 2))
        state = client.ask_until(lambda f: f["refused"] > len(BAD))["state"]
    assert "version 2" in state
    assert "version 1" in state
    assert client.close() == ("closed", 0)


def test_a_server_with_curve_is_named(connecting):
    public, secret = zmq.curve_keypair()
    with publisher(CURVE_SERVER=1, CURVE_PUBLICKEY=public, CURVE_SECRETKEY=secret) as (_, address):
        client = connecting(address)
        client.ask_until(lambda f: "CURVE" in f["state"])
        assert client.close() == ("closed", 0)


def test_another_protocol_is_noticed(connecting):
    with http.server.HTTPServer(("127.0.0.1", 0), http.server.BaseHTTPRequestHandler) as server:
        server.RequestHandlerClass.log_message = lambda *_: None  # type: ignore[assignment]
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05})
        thread.start()
        client = connecting(f"tcp://127.0.0.1:{server.server_address[1]}")
        figures = client.ask_until(lambda f: f["state"].startswith("reconnecting"))
        assert figures["received"] == 0
        assert client.close() == ("closed", 0)
        server.shutdown()
        thread.join()


def test_a_frame_that_is_too_large_ends_the_connection(connecting):
    with publisher(RCVTIMEO=20_000) as (pub, address):
        client = connecting(address)
        pub.recv()
        pub.send(TOPIC_BIN + bytes(200_000))
        client.ask_until(lambda f: f["state"].startswith("reconnecting"))
        pub.recv()  # the end of the connection unsubscribes it
        assert pub.recv() == b"\x01" + TOPIC_BIN
        pub.send(TOPIC_BIN + encode_binary(message(0, 0.0, 0.0)))
        client.ask_until(lambda f: f["received"] == 1)


def test_silence_is_bridged_by_pings(connecting):
    """A silent server that answers pings keeps its clients; one that does not answer loses them."""
    with publisher(RCVTIMEO=20_000) as (pub, address):
        client = connecting(address)
        pub.recv()
        assert not pub.poll(3_500)  # longer than a client waits for a dead server
        pub.send(TOPIC_BIN + encode_binary(message(0, 0.0, 0.0)))
        client.ask_until(lambda f: f["received"] == 1)
    with socket.create_server(("127.0.0.1", 0)) as mute:
        client = connecting(f"tcp://127.0.0.1:{mute.getsockname()[1]}")
        client.ask_until(lambda f: f["state"].startswith("reconnecting"))
