"""What every client promises, checked on live servers.

The reader never waits for the program, the newest frame is shown, silence fades, losses are counted, lost connections
are restored with growing pauses, frames cost no allocations, and the client ends cleanly.
"""

import os
import signal
import socket
import time
from itertools import pairwise

import pytest
from checkout import VECTORS, publishing
from languages import NAMES, LiveClient, run
from manipnet_client import Client

BACK_OFF_S = (0.1, 0.2, 0.4, 0.8, 1.0)
MANY_FRAMES, WARM_FRAMES = 3000, 200


@pytest.fixture(params=NAMES)
def name(request):
    return request.param


@pytest.fixture
def live(name, harness):
    """Starts the client at the address of its protocol and kills it at the end."""
    command, clients = harness(name), []

    def start(tcp, websocket, verb="live"):
        clients.append(LiveClient.start(command, websocket if name == "javascript" else tcp, verb))
        return clients[-1]

    yield start
    for client in clients:
        client.kill()


def test_reads_while_the_program_is_busy(live, name):
    if name == "javascript":
        pytest.skip(
            "a page has one thread: the browser receives meanwhile, and the client reads the newest frame afterwards"
        )
    with publishing() as (_, tcp, websocket), Client(tcp) as other:
        client = live(tcp, websocket, "idle")  # its main thread only waits for questions
        before = client.ask_until(lambda f: f["received"] > 0)
        until = other.stats().seq + 120
        while other.stats().seq < until:
            other.wait(after=other.newest, timeout_s=10)
        after = client.ask_until(lambda f: f["received"] >= before["received"] + 60)
        assert after["lost"] == 0
        assert client.close() == ("closed", 0)


def test_counts_what_is_lost(live):
    with publishing("--skip", "5") as (_, tcp, websocket):
        figures = live(tcp, websocket).ask_until(lambda f: f["received"] > 60)
        assert abs(figures["lost"] - figures["received"] / 4) <= 1
        assert figures["refused"] == 0
        assert figures["rate_hz"] > 0
        assert figures["age_s"] >= 0


def test_silence_fades_and_a_restarted_server_is_found(live):
    with publishing("--session", "a") as (process, tcp, websocket):
        client = live(tcp, websocket)
        figures = client.ask_until(lambda f: f["received"] > 60 and f["weight"] == 1)
        assert (figures["lost"], figures["refused"], figures["connections"]) == (0, 0, 1)
        process.kill()
        process.wait()
        silent = client.ask_until(lambda f: f["weight"] == 0 and f["rate_hz"] == 0)
        assert silent["state"].startswith("reconnecting")
        assert silent["age_s"] > 1
        assert silent["shows"] > figures["shows"]
        ports = [address.rpartition(":")[2] for address in (tcp, websocket)]
        with publishing("--session", "b", "--port", ports[0], "--websocket-port", ports[1]):
            figures = client.ask_until(lambda f: f["session"] == "b" and f["weight"] == 1)
        assert (figures["lost"], figures["connections"]) == (0, 2)
    assert client.close() == ("closed", 0)


def test_backs_off_from_a_server_that_hangs_up(live):
    """The pauses grow; only their lower bounds are asserted, because a busy machine makes them longer."""
    with socket.create_server(("127.0.0.1", 0)) as rude:
        address = f"127.0.0.1:{rude.getsockname()[1]}"
        client, times = live(f"tcp://{address}", f"ws://{address}"), []
        for _ in range(6):
            with rude.accept()[0] as connection:
                times.append(time.monotonic())
                connection.sendall(b"HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\n\r\n")
        assert client.close() == ("closed", 0)
    waits = [later - sooner for sooner, later in pairwise(times)]
    assert all(wait > 0.9 * least for wait, least in zip(waits, BACK_OFF_S, strict=True)), waits


def test_no_garbage_per_frame(live, name):
    """C# makes no collection although 64 kB would cause one, so less than 22 bytes per frame; C++ allocates nothing.

    The measurement starts after every slot of the ring has held a frame with as many bodies.
    """
    if name in ("javascript", "python"):
        pytest.skip("the language allocates for every frame")
    with publishing("--rate", "600") as (_, tcp, websocket), Client(tcp) as other:
        client = live(tcp, websocket)
        start = client.ask_until(lambda f: f["received"] - f["late"] > WARM_FRAMES)
        until = other.stats().seq + MANY_FRAMES
        while other.stats().seq < until:
            other.wait(after=other.newest, timeout_s=10)
        end = client.ask()
    assert end["received"] > start["received"] + 0.9 * MANY_FRAMES
    assert end.get("allocations", 0) == end.get("collections", 0) == 0


def test_javascript_makes_little_garbage(harness):
    """Per frame it allocates a view of the message and boxed numbers; the joints keep their memory."""
    (bytes_per_frame,) = run(harness("javascript"), "garbage", str(VECTORS / "live.bin"))
    assert float(bytes_per_frame) < 512


def test_a_client_stopped_resumes_with_the_newest(live):
    with publishing() as (_, tcp, websocket), Client(tcp) as other:
        client = live(tcp, websocket)
        before = client.ask_until(lambda f: f["shown_seq"] > 30)
        os.kill(client.process.pid, signal.SIGSTOP)
        hands = other.wait(timeout_s=10)
        while hands and hands.seq < before["shown_seq"] + 150:
            hands = other.wait(after=hands, timeout_s=10)
        assert hands is not None
        os.kill(client.process.pid, signal.SIGCONT)
        seen = []
        while not seen or seen[-1] < hands.seq - 5:
            seen.append(client.ask()["shown_seq"])
    # It shows what it held and then the newest frames, and no frame of the backlog in between.
    assert all(s <= before["shown_seq"] + 45 or s >= hands.seq - 45 for s in seen), seen
