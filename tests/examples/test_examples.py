"""Every example runs as its docstring says, against a real server."""

import os
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest
from live_server import LiveServer, Subscriber, scene, serving

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
PATIENCE_S = 240.0
ENVIRONMENT = os.environ | {
    "PYTHONPATH": os.pathsep.join([str(ROOT / "clients" / "python"), *filter(None, [os.environ.get("PYTHONPATH")])])
}


@pytest.fixture(scope="module")
def server(tiny_bundle: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    takes = tmp_path_factory.mktemp("takes")
    with serving("--mesh", "Box=cube", "--model", str(tiny_bundle), "--takes", str(takes)) as server:
        yield server


def finished(name: str, *arguments: str) -> str:
    """What an example printed that ends by itself."""
    done = subprocess.run(
        [sys.executable, EXAMPLES / name, *arguments],
        env=ENVIRONMENT,
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@contextmanager
def running(name: str, *arguments: str) -> Iterator[subprocess.Popen]:
    """An example that runs until it is stopped; it is given up after a while, so that reading from it ends."""
    with subprocess.Popen(
        [sys.executable, EXAMPLES / name, *arguments], env=ENVIRONMENT, stdout=subprocess.PIPE, text=True
    ) as process:
        give_up = threading.Timer(PATIENCE_S, process.kill)
        give_up.start()
        try:
            yield process
        finally:
            give_up.cancel()
            process.kill()


def test_every_example_is_tested() -> None:
    tested = Path(__file__).read_text(encoding="utf-8")
    names = sorted(path.name for path in EXAMPLES.glob("*.py"))
    assert [name for name in names if f'"{name}"' not in tested] == []


def test_bodies_are_sent_and_hands_received(server: LiveServer) -> None:
    with (
        running("send_bodies.py", server.addresses["bodies"]),
        running("receive_hands.py", server.addresses["hands"]) as receiver,
    ):
        assert receiver.stdout is not None
        for line in receiver.stdout:
            if "left is live on Box, index tip at (" in line and "right is live on Box" in line:
                return
    pytest.fail("the example printed no line about live hands")


def test_a_recording_is_made_and_replayed(server: LiveServer) -> None:
    subscriber = Subscriber(server.addresses["hands"])
    printed = finished("record_and_replay.py", server.addresses["control"], server.addresses["bodies"])
    recorded, replayed = printed.splitlines()
    assert " frames of bodies, " in recorded
    assert replayed == "replayed"
    latest_s = subscriber.next().t_capture
    while (t_s := subscriber.next().t_capture) > latest_s - 1.0:  # the replay goes back to where the recording began
        latest_s = t_s
    subscriber.close()


def test_a_ring_is_brought_in_and_carried(server: LiveServer) -> None:
    assert finished("own_object.py", "Box", server.addresses["control"]).startswith("Box carries ring from message ")
    assert server.ask({"op": "objects"})["bodies"]["actor"]["Box"]["object"] == "ring"


def test_fingers_are_synthesised_offline() -> None:
    lines = finished("synthesise_offline.py").splitlines()
    assert [line.split(" s ")[0] for line in lines] == ["0.00", "0.25", "0.50", "0.75", "1.00", "1.25"]
    assert lines[0].split(" s ")[1] != lines[-1].split(" s ")[1]


def test_bodies_come_in_by_a_protocol_of_its_own(tiny_bundle: Path) -> None:
    options = ["--mesh", "Box=cube", "--model", str(tiny_bundle), "--text-port=0"]
    with serving(*options, program=[str(EXAMPLES / "own_protocol.py")]) as server:
        subscriber = Subscriber(server.addresses["hands"])
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
            udp.connect(("127.0.0.1", int(server.addresses["text"].rpartition(":")[2])))
            udp.send(b"now\nBox")
            for frame in range(90):
                udp.send("\n".join([str(frame / 60), *map(line, scene(frame / 60).items())]).encode())
        assert "live" in {hand.state for hand in subscriber.next().hands.values()}
        subscriber.close()
        counters = server.ask({"op": "status"})["counters"]
    assert counters["frames_in"]["text"] == 90
    assert counters["frames_dropped"]["malformed"] == 1


def line(body: tuple[str | int, Sequence[float] | None]) -> str:
    name, pose = body
    return " ".join(map(str, (name, *(pose or ()))))
