"""The demo: a recording that is played again and again through the server's own socket."""

import math
import queue
from pathlib import Path

import numpy as np
import pytest
from live_server import Subscriber, serving

from manipnet.common.options import ConfigError
from manipnet.config.settings import parse_object
from manipnet.demo.player import DEMO_FILE, DEMO_OBJECTS, Demo, connectable, demo_objects
from manipnet.inputs.zeromq import ZEROMQ
from manipnet.inputs.zeromq.receiver import ZmqBodies
from manipnet.recording.mcap_file import RecordingWriter, read_bodies
from manipnet.telemetry import Telemetry
from manipnet.tracking.outlier_gate import OutlierGate
from manipnet.wire.bodies import BodyFrame, BodySample


def test_it_loops_without_a_jump_in_time(tmp_path: Path) -> None:
    path = tmp_path / "demo.mcap"
    with RecordingWriter(path, {}) as writer:
        for k in range(20):
            body = BodySample(None, "cube", (math.cos(0.1 * math.pi * k), 1.0, 0.0), (0.0, 0.0, 0.0, 1.0), True)
            writer.write_bodies(BodyFrame(k / 240, k, (body,), 0.0, "test"), k * 4_166_667)
    heard: queue.Queue[BodyFrame] = queue.Queue()
    receiver = ZmqBodies(ZEROMQ.intake(heard.put, Telemetry()), port=0)
    receiver.start()
    demo = Demo(path)
    demo.start(receiver.address)
    frames = [heard.get(timeout=30.0) for _ in range(50)]
    demo.stop()
    receiver.stop()
    assert [frame.frame for frame in frames] == list(range(50))
    assert np.allclose(np.diff([frame.t_s for frame in frames]), 1 / 240)
    assert frames[20].bodies == frames[0].bodies


def test_the_performance_ends_as_it_begins() -> None:
    frames = list(read_bodies(DEMO_FILE))
    names = {body.name for body in frames[0].bodies}
    assert names == {"left_wrist", "right_wrist", *DEMO_OBJECTS}
    assert np.allclose(np.diff([frame.t_s for frame in frames]), 1 / 120)
    for first, last in zip(frames[0].bodies, frames[-1].bodies, strict=True):
        assert np.allclose(first.p, last.p, atol=2e-3)
        assert abs(np.dot(first.q, last.q)) > math.cos(math.radians(0.5))


def test_a_prop_that_lies_still_in_every_loop_is_never_rejected_as_frozen() -> None:
    frames, gate = list(read_bodies(DEMO_FILE)), OutlierGate()
    period_s = frames[-1].t_s + frames[1].t_s - 2.0 * frames[0].t_s
    for loop in range(10):
        for frame in frames:
            assert gate.check(frame._replace(t_s=frame.t_s + loop * period_s, source="demo"))[1] == []


def test_the_server_plays_the_demo(tiny_bundle: Path) -> None:
    with serving("--demo", "--model", str(tiny_bundle)) as server:
        subscriber = Subscriber(server.addresses["hands"])
        messages = [subscriber.next() for _ in range(60)]
        assert {hand.state for hand in messages[-1].hands.values()} == {"live"}
        assert {hand.object for hand in messages[-1].hands.values()} <= set(DEMO_OBJECTS)
        assert {body.name for body in messages[-1].bodies} == {"left_wrist", "right_wrist", *DEMO_OBJECTS}
        assert server.stop() == 0
        subscriber.close()


def test_meshes_of_the_demos_props_may_be_replaced_and_no_others() -> None:
    swapped = demo_objects((parse_object("cube=duck.ply"),))
    assert [thing.name for thing in swapped] == list(DEMO_OBJECTS)
    assert swapped[0].mesh == Path("duck.ply")
    with pytest.raises(ConfigError, match="with --demo the bodies are cube, cylinder, mug"):
        demo_objects((parse_object("Box=duck.ply"),))


def test_a_demo_without_its_recording_says_so(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"--demo: .*gone\.mcap: cannot be read"):
        Demo(tmp_path / "gone.mcap")


@pytest.mark.parametrize(
    ("address", "reached"),
    [
        ("tcp://127.0.0.1:5556", ("127.0.0.1", 5556)),
        ("tcp://0.0.0.0:1", ("127.0.0.1", 1)),
        ("tcp://[::]:2", ("::1", 2)),
    ],
)
def test_a_socket_on_all_addresses_is_reached_on_loopback(address: str, reached: tuple[str, int]) -> None:
    assert connectable(address) == reached
