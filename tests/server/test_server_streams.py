"""A real server that receives NatNet from a fake Motive, and OSC as `manipnet replay` sends it."""

import socket
import time
import urllib.request

import numpy as np
import pytest
from fake_motive import FakeMotive
from live_server import Subscriber, scene, serving
from natnet_writer import Body, Frame
from osc_writer import bundle, osc

from manipnet.synthesis.objects.library import LIBRARY_FOLDER

RATE_HZ, SECONDS = 120, 2.0
NAMES = {1: "left_wrist", 2: "right_wrist", 3: "Box"}


@pytest.fixture(scope="module")
def motive():
    with FakeMotive((4, 1), NAMES) as motive:
        yield motive


@pytest.fixture(scope="module")
def server(tiny_bundle, motive):
    options = ("--mesh", f"Box={LIBRARY_FOLDER / 'cube.ply'}", "--model", str(tiny_bundle), "--look-ahead", "0.1")
    with serving(*options, "--natnet", f"127.0.0.1:{motive.port}", "--metrics-port=0") as server:
        motive.wait_for(12)
        yield server


def natnet_frame(motive, n, poses):
    bodies = [Body(id, tuple(poses[name][:3]), tuple(poses[name][3:])) for id, name in NAMES.items()]
    motive.send(Frame(n, bodies, 5_000 + n / RATE_HZ).write(motive.version))


def osc_frame(udp, n, poses):
    bodies = [osc(f"/rigidbody/{name}/transformation", *map(float, pose)) for name, pose in poses.items()]
    tracked = [osc(f"/rigidbody/{name}/tracked", 1) for name in poses]
    stamp = osc("/frame/timestamp", ("d", 1e3 * (9_000 + n / RATE_HZ)))
    udp.send(bundle(osc("/frame/start", n), stamp, *bodies, *tracked, osc("/frame/end", n)))


def perform(server, send, start_s):
    """Send the scene in real time; the messages of the second half."""
    subscriber = Subscriber(server.addresses["hands"])
    begin_s = time.monotonic()
    for n in range(round(SECONDS * RATE_HZ)):
        time.sleep(max(begin_s + n / RATE_HZ - time.monotonic(), 0.0))
        send(n, scene(n / RATE_HZ))
    messages = [m for m in subscriber.until(start_s + SECONDS - 0.3) if m.t_capture >= start_s + 1.0]
    subscriber.close()
    return messages


def assert_live(messages, start_s):
    assert len(messages) >= 40
    assert np.allclose(np.diff([m.t_capture for m in messages]), 1 / 60)
    for message in messages:
        truth = scene(message.t_capture - start_s)
        assert {side: hand.state for side, hand in message.hands.items()} == {"left": "live", "right": "live"}
        assert np.allclose(message.hands["right"].wrist[:3], truth["right_wrist"][:3], atol=2e-3)


def test_natnet_to_hands(server, motive):
    messages = perform(server, lambda n, poses: natnet_frame(motive, n, poses), 5_000.0)
    assert_live(messages, 5_000.0)
    status = server.ask({"op": "status"})
    assert status["counters"]["frames_in"]["natnet"] == SECONDS * RATE_HZ
    assert status["natnet"]["state"] == "streaming"
    assert status["natnet"]["problem"] is None
    assert status["natnet"]["bodies"] == {"1": "left_wrist", "2": "right_wrist", "3": "Box"}
    (sender,) = (said for source, said in status["senders"].items() if source.startswith("natnet:"))
    assert sender["clock_offset_s"] == pytest.approx(status["natnet"]["capture_offset_s"])
    assert sender["clock_uncertainty_s"] == status["natnet"]["clock_uncertainty_s"] > 0.0
    with urllib.request.urlopen(server.addresses["metrics"], timeout=20.0) as response:
        text = response.read().decode()
    assert 'manipnet_natnet_state{state="streaming"} 1.0' in text
    assert 'manipnet_natnet_state{state="connecting"} 0.0' in text
    assert 'manipnet_clock_offset_seconds{clock="natnet"}' in text
    assert 'manipnet_clock_uncertainty_seconds{clock="natnet"}' in text
    assert 'manipnet_connections{socket="hands"}' in text
    assert 'manipnet_body_rate_hz{body="actor/Box"}' in text
    assert 'manipnet_body_age_seconds{body="actor/left_wrist"}' in text


def test_osc_to_hands(server):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.connect(("127.0.0.1", int(server.addresses["osc"].rpartition(":")[2])))
        messages = perform(server, lambda n, poses: osc_frame(udp, n, poses), 9_000.0)
    assert_live(messages, 9_000.0)
    assert server.ask({"op": "status"})["counters"]["frames_in"]["osc"] == SECONDS * RATE_HZ
