"""Broken ZMTP and HTTP at every TCP port: the ticks go on, and good clients are served meanwhile and afterwards.

`pytest tests/fuzz/test_fuzz_ports.py --fuzz-seconds 600 --fuzz-seed 1` goes on for ten minutes.
"""

import http.client
import os
import sys
import time
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import viser
from fuzz_ports import busiest_thread, talking
from live_server import PATIENCE_S, LiveServer, Sender, Stage, Subscriber, scene, serving
from websockets.exceptions import ConnectionClosedError
from websockets.sync.client import connect
from websockets.typing import Subprotocol

SECONDS = 6.0
TICK_HZ = 60.0
SUBPROTOCOL = f"viser-v{viser.__version__}"
MOST_OF_A_CORE = 0.6


@pytest.mark.slow
def test_nonsense_at_every_port_hurts_nobody(tiny_bundle: Path, fuzz_seconds, fuzz_seed, report_line) -> None:
    seconds = SECONDS if fuzz_seconds is None else fuzz_seconds
    with serving("--mesh", "Box=cube", "--model", str(tiny_bundle), "--metrics-port", "0") as server:
        watch_page(server)
        stage, load = Stage(server), []
        with talking(server, fuzz_seed, SUBPROTOCOL) as outcome:
            begin_s, ticks, missing, played_s = time.monotonic(), 0, 0, 0.0
            while time.monotonic() < begin_s + seconds:
                messages = stage.perform(min(SECONDS, seconds), scene)
                ticks, played_s = ticks + len(messages) - 1, played_s + min(SECONDS, seconds)
                missing += messages[-1].seq - messages[0].seq + 1 - len(messages)
                load.append(os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan"))
        counters = server.ask({"op": "status"})["counters"]
        stage.close()
        assert_good_clients_are_served(server)
        share = busiest_thread(server.process.pid, 2.0) if sys.platform == "linux" else 0.0
        errors = "\n".join(server.errors)
    report_line(
        f"ports: {sum(outcome.talks.values())} conversations in {seconds:g} s ({dict(outcome.talks)}, not reached "
        f"{dict(outcome.refused)}), {ticks / played_s:.2f} ticks a second, {missing} missing, skipped "
        f"{counters.get('ticks_skipped', {})}, refused {counters['connections_refused']}, busiest thread afterwards "
        f"{share:.0%} of a core, load {min(load):.1f} to {max(load):.1f}, seed {fuzz_seed}"
    )
    assert min(outcome.talks.values()) > 0
    assert missing == 0
    assert ticks >= 0.95 * TICK_HZ * played_s
    assert counters.get("page_ended", {}) == {}
    assert counters.get("receiver_restarts", {}) == {}
    assert share < MOST_OF_A_CORE
    assert "Traceback" not in errors, errors


def assert_good_clients_are_served(server: LiveServer) -> None:
    """A new sender moves the hands, and a new client, the page, the stream for pages, and the metrics answer."""
    subscriber, sender = Subscriber(server.addresses["hands"]), Sender(server.addresses["bodies"])
    begin_s, start_s = time.monotonic(), 1e6
    for i in range(180):
        time.sleep(max(begin_s + i / 120.0 - time.monotonic(), 0.0))
        sender.send(start_s + i / 120.0, scene(i / 120.0))
    message = subscriber.until(start_s + 0.9)[-1]
    sender.close()
    subscriber.close()
    assert message.hands["left"].state == "live"
    report = server.ask({"op": "status"})
    assert all(receiver["state"] == "listening" for receiver in report["receivers"].values())
    for name in ("page", "metrics"):
        address = urlsplit(server.addresses[name])
        connection = http.client.HTTPConnection(address.netloc, timeout=PATIENCE_S)
        connection.request("GET", address.path or "/")
        assert connection.getresponse().status == 200
        connection.close()
    with connect(server.addresses["web"]) as web:
        web.close()
    watch_page(server)


def watch_page(server: LiveServer) -> None:
    """Connect to the page as its own client does, and wait until it sends something.

    viser ends a connection with 1011 if the scene grows while it is copied for the visitor, whose browser then connects
    again; so does this.
    """
    try:
        _receive_once(server)
    except ConnectionClosedError:
        _receive_once(server)


def _receive_once(server: LiveServer) -> None:
    address = server.addresses["page"].replace("http:", "ws:")
    with connect(address, subprotocols=[Subprotocol(SUBPROTOCOL)], max_size=None, open_timeout=PATIENCE_S) as page:
        assert page.recv(PATIENCE_S)
