"""The Python client with keys: on the list, not on it, with another server's key, and on a real server."""

import socket
import time
from contextlib import contextmanager
from threading import Thread
from types import SimpleNamespace

import pytest
import zmq
from live_server import serving
from manipnet_client import Client, subscribe
from publisher import message
from zmq.auth.thread import ThreadAuthenticator

from manipnet.inputs.playback import OscBodySender
from manipnet.net.curve_keys import make_client_keys, make_server_keys, read_client_keys, read_server_keys
from manipnet.synthesis.objects.library import LIBRARY_FOLDER
from manipnet.wire import TOPIC_BIN, encode_binary
from manipnet.wire.bodies import BodyFrame, BodySample

DOMAIN = "hands"
WRISTS = tuple(
    BodySample(None, f"{side}_wrist", (x_m, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0), True)
    for side, x_m in (("left", 0.14), ("right", -0.14))
)


@pytest.fixture
def folder(tmp_path):
    """A folder with the keys of a server and of a listed client."""
    make_server_keys(tmp_path)
    make_client_keys(tmp_path, "listed")
    return tmp_path


@contextmanager
def publisher(folder):
    """A publisher with the server's keys that admits only the client "listed"."""
    keys, listed = read_server_keys(folder), read_client_keys(folder / "listed.toml").pair.public
    context = zmq.Context()
    gate = ThreadAuthenticator(context)
    gate.start()
    knows = SimpleNamespace(callback=lambda _, key: key == listed.encode())
    gate.configure_curve_callback(DOMAIN, knows)
    pub = context.socket(zmq.XPUB)
    pub.setsockopt(zmq.LINGER, 0)
    pub.setsockopt(zmq.RCVTIMEO, 20_000)
    pub.setsockopt(zmq.CURVE_SERVER, 1)
    pub.setsockopt_string(zmq.CURVE_SECRETKEY, keys.pair.secret)
    pub.setsockopt_string(zmq.ZAP_DOMAIN, DOMAIN)
    try:
        yield pub, f"tcp://127.0.0.1:{pub.bind_to_random_port('tcp://127.0.0.1')}"
    finally:
        pub.close()
        gate.stop()
        context.term()


def wait_for_state(client, words):
    """Wait until the client reports `words`; it reports the same state again after every attempt."""
    for _ in range(2_000):
        if words in client.stats().state:
            return
        client.wait(timeout_s=0.01)
    pytest.fail(client.stats().state)


def test_a_listed_client_reads(folder):
    with publisher(folder) as (pub, address), Client(address, keys=folder / "listed.toml") as client:
        assert pub.recv() == b"\x01" + TOPIC_BIN
        pub.send_multipart([TOPIC_BIN, b"of many parts"])
        for k in range(3):
            pub.send(TOPIC_BIN + encode_binary(message(k, k / 60, 0.0)))
        while client.stats().received < 3:
            assert client.wait(after=client.newest, timeout_s=10)
        assert (client.stats().lost, client.stats().connections) == (0, 1)
    assert client.stats().state == "closed"


def test_a_client_reconnects(folder):
    with publisher(folder) as (pub, address), Client(address, keys=folder / "listed.toml") as client:
        assert pub.recv() == b"\x01" + TOPIC_BIN
        pub.send(TOPIC_BIN + bytes(200_000))  # larger than any message, so the client closes the connection
        assert pub.recv() == b"\0" + TOPIC_BIN
        assert pub.recv() == b"\x01" + TOPIC_BIN
        pub.send(TOPIC_BIN + encode_binary(message(0, 0.0, 0.0)))
        assert client.wait(timeout_s=10)
        assert client.stats().connections == 2


def test_iteration(folder):
    with publisher(folder) as (pub, address):
        hands = subscribe(address, keys=str(folder / "listed.toml"))
        reading = Thread(target=next, args=(hands,))
        reading.start()
        pub.recv()
        pub.send(TOPIC_BIN + encode_binary(message(0, 0.0, 0.0)))
        reading.join(20)
        assert not reading.is_alive()
        hands.close()


def test_a_refused_client_reports_the_reason(folder, tmp_path_factory):
    other = tmp_path_factory.mktemp("other")
    make_server_keys(other)
    make_client_keys(folder, "unlisted")
    make_client_keys(other, "stranger")
    with publisher(folder) as (_, address):
        with Client(address, keys=folder / "unlisted.toml") as client:
            wait_for_state(client, "does not list this client's key")
        with Client(address, keys=other / "stranger.toml") as client:
            wait_for_state(client, "check that its key is the one in this file")
        with Client(address) as client:
            wait_for_state(client, "requires CURVE; pass `keys` to this client")


def test_a_server_without_curve_and_no_server_at_all(folder):
    with zmq.Context() as context, context.socket(zmq.PUB) as pub:
        port = pub.bind_to_random_port("tcp://127.0.0.1")
        with Client(f"tcp://127.0.0.1:{port}", keys=folder / "listed.toml") as client:
            wait_for_state(client, "does not use CURVE")
    with socket.socket() as reserved:
        reserved.bind(("127.0.0.1", 0))  # without listening, so that connections to it are refused
        address = f"tcp://127.0.0.1:{reserved.getsockname()[1]}"
        with Client(address, keys=folder / "listed.toml") as client:
            wait_for_state(client, "no server answers")


@pytest.mark.parametrize("text", [None, "", 'public = "short"'])
def test_a_wrong_file_of_keys(tmp_path, text):
    path = tmp_path / "keys.toml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ValueError, match="manipnet keys make NAME"):
        Client("tcp://127.0.0.1:1", keys=path)


def test_the_real_server_lets_its_client_in(folder, tiny_bundle):
    options = ["--mesh", f"Box={LIBRARY_FOLDER / 'cube.ply'}", "--model", str(tiny_bundle), "--keys", str(folder)]
    with serving(*options) as server, Client(server.addresses["hands"], keys=folder / "listed.toml") as client:
        host, port = server.addresses["osc"].rpartition("/")[2].split(":")
        sender = OscBodySender(host, int(port))  # OSC has no keys; the server accepts it from this machine
        start = time.monotonic()
        while client.newest is None:
            t = time.monotonic() - start
            assert t < 60.0
            sender.send(BodyFrame(t, None, WRISTS, t, "test"))
            time.sleep(1 / 120)
        sender.close()
