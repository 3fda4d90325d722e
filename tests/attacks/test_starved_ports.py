"""Connections that say nothing, on every port: whoever is allowed in still comes in, and nothing runs out."""

import os
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import zmq
from live_server import PATIENCE_S, LiveServer, serving

from manipnet.net.curve_keys import ClientKeys, make_client_keys, make_server_keys, read_client_keys
from manipnet.net.zap import secure_client

CROWD = 150


@pytest.fixture
def keys(tmp_path: Path) -> tuple[Path, ClientKeys]:
    """Keys of a server, and those of a client on its list."""
    make_server_keys(tmp_path)
    make_client_keys(tmp_path, "listed")
    return tmp_path, read_client_keys(tmp_path / "listed.toml")


@contextmanager
def crowd(address: str, count: int, first: bytes = b"") -> Iterator[None]:
    """`count` connections that send `first` and then nothing, each opened again when the server closes it."""
    split, stopping = urlsplit(address), threading.Event()

    def keep_open() -> None:
        while not stopping.is_set():
            try:
                with socket.create_connection((split.hostname or "", split.port or 0), timeout=5.0) as connection:
                    connection.settimeout(0.2)
                    connection.sendall(first)
                    while not stopping.is_set():
                        try:
                            if not connection.recv(4096):
                                break
                        except TimeoutError:
                            pass
            except OSError:
                stopping.wait(0.05)

    threads = [threading.Thread(target=keep_open, daemon=True) for _ in range(count)]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        stopping.set()
        for thread in threads:
            thread.join(PATIENCE_S)


def open_files(server: LiveServer) -> int:
    return len(os.listdir(f"/proc/{server.process.pid}/fd"))


GREETING = b"\xff\x00\x00\x00\x00\x00\x00\x00\x01\x7f\x03\x00CURVE" + bytes(47)


@pytest.mark.parametrize("first", [b"", GREETING], ids=["silent", "greeting"])
@pytest.mark.parametrize("port", ["hands", "control"])
def test_a_listed_client_stays_connected_in_a_crowd_of_strangers(
    tiny_bundle: Path, keys: tuple[Path, ClientKeys], port: str, first: bytes
) -> None:
    folder, client = keys
    with (
        serving("--keys", str(folder), "--model", str(tiny_bundle)) as server,
        crowd(server.addresses[port], CROWD, first),
        zmq.Context() as context,
        context.socket(zmq.REQ if port == "control" else zmq.SUB) as own,
    ):
        own.setsockopt(zmq.LINGER, 0)
        secure_client(own, client)
        monitor = own.get_monitor_socket(zmq.EVENT_HANDSHAKE_SUCCEEDED | zmq.EVENT_DISCONNECTED)
        own.connect(server.addresses[port])
        assert monitor.poll(int(1e3 * PATIENCE_S)), "a listed client is kept out"
        monitor.recv_multipart()
        assert not monitor.poll(5_000), "a listed client was cut off again"
        own.disable_monitor()
        monitor.close()


@pytest.mark.parametrize(("port", "first"), [("web", b""), ("page", b""), ("metrics", b"GET / HTTP/1.1\r\n")])
def test_half_open_connections_are_bounded(tiny_bundle: Path, port: str, first: bytes) -> None:
    with serving("--model", str(tiny_bundle), "--metrics-port", "0") as server:
        before, begin_s = open_files(server), time.monotonic()
        with crowd(server.addresses[port], 300, first):
            most = 0
            while time.monotonic() < begin_s + 4.0:
                most = max(most, open_files(server))
                time.sleep(0.1)
        assert most - before < 150
        assert "counters" in server.ask({"op": "status"})
