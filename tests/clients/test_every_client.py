"""What every client promises, against live servers: the reader waits for nobody, newest wins, silence fades, losses are
counted, it comes back, backs off, makes no garbage, and ends."""

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
    """Starts the client at the address it understands, and ends it."""
    command, clients = harness(name), []

    def start(tcp, websocket, verb="live"):
        clients.append(LiveClient.start(command, websocket if name == "javascript" else tcp, verb))
        return clients[-1]

    yield start
    for client in clients:
        client.kill()


def test_reads_while_the_program_is_busy(live, name):
    if name == "javascript":
        pytest.skip("a page has one thread: the browser receives meanwhile, the client takes the newest afterwards")
    with publishing() as (_, tcp, websocket), Client(tcp) as other:
        client = live(tcp, websocket, "idle")  # its main thread waits for our questions and does nothing else
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
    """Waits grow; only their least is asserted, a busy machine makes them longer."""
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
    """C#: no collection though 64 kB are enough for one, so less than 22 bytes a frame. C++: nothing at all.

    Before, every place of the ring must have held a frame with as many bodies.
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


def test_javascript_makes_next_to_no_garbage(harness):
    """A view of the message, and numbers the engine boxes; it holds 26 joints of two hands in the same memory."""
    (bytes_per_frame,) = run(harness("javascript"), "garbage", str(VECTORS / "live.bin"))
    assert float(bytes_per_frame) < 512


def test_a_client_stopped_resumes_with_the_newest(live):
    with publishing() as (_, tcp, websocket), Client(tcp) as other:
        client = live(tcp, websocket)
        before = client.ask_until(lambda f: f["shown_seq"] > 30)
        os.kill(client.process.pid, signal.SIGSTOP)
        hands = other.wait()
        while hands.seq < before["shown_seq"] + 150:
            hands = other.wait(after=hands, timeout_s=10)
        os.kill(client.process.pid, signal.SIGCONT)
        seen = []
        while not seen or seen[-1] < hands.seq - 5:
            seen.append(client.ask()["shown_seq"])
    # What it held, then what is new: nothing of the backlog in between.
    assert all(s <= before["shown_seq"] + 45 or s >= hands.seq - 45 for s in seen), seen
