"""A take played through real sockets: every frame arrives unchanged, and a server makes hands of every tick."""

import queue
import threading
from collections.abc import Iterator
from itertools import islice, pairwise
from pathlib import Path

import numpy as np
import pytest
from live_server import Stage, scene

from manipnet.inputs.osc import OSC
from manipnet.inputs.osc.receiver import OscBodies
from manipnet.inputs.osc.writer import osc_datagrams
from manipnet.inputs.playback import OscBodySender, PlayError, looped, play
from manipnet.inputs.zeromq import ZEROMQ
from manipnet.inputs.zeromq.receiver import ZmqBodies
from manipnet.telemetry import Telemetry
from manipnet.tracking.tick import TICK_S
from manipnet.wire.bodies import BodyFrame, BodySample, MessageError
from manipnet_tools import cli
from manipnet_tools.commands import replay
from manipnet_tools.takes.take import BodyTrack, Take


def frames(count: int, start_s: float = 100.0, bodies: int = 2) -> list[BodyFrame]:
    rng = np.random.default_rng(5)
    return [
        BodyFrame(
            start_s + k / 240,
            k,
            tuple(
                BodySample(
                    None if i else 3,
                    f"body {i}" if i else None,
                    tuple(rng.normal(size=3).astype(np.float32).tolist()),
                    (0.0, 0.0, 0.0, 1.0),
                    (k + i) % 3 > 0,
                )
                for i in range(bodies)
            ),
            0.0,
            "test",
        )
        for k in range(count)
    ]


class Receiving:
    """A receiver of the server, and the frames it has received."""

    def __init__(self, kind: str) -> None:
        self.heard: queue.Queue[BodyFrame] = queue.Queue()
        make, declared = (ZmqBodies, ZEROMQ) if kind == "tcp" else (OscBodies, OSC)
        self.receiver = make(declared.intake(self.heard.put, Telemetry()), port=0)
        self.receiver.start()
        self.url = f"{kind}://{self.receiver.address.partition('://')[2]}"


@pytest.fixture(params=["tcp", "osc"])
def receiving(request: pytest.FixtureRequest) -> Iterator[Receiving]:
    receiving = Receiving(request.param)
    yield receiving
    receiving.receiver.stop()


def test_every_frame_arrives_as_it_was_sent(receiving: Receiving) -> None:
    sent = frames(60)
    sender = replay.connect(receiving.url)
    played = play(sent, sender)
    heard = [receiving.heard.get(timeout=30.0) for _ in sent]
    sender.close()
    assert played.frames == 60
    for a, b in zip(sent, heard, strict=True):
        assert b.t_s == pytest.approx(a.t_s, abs=1e-9)
        assert b.frame == a.frame
        assert [x.tracked for x in b.bodies] == [x.tracked for x in a.bodies]
        assert [(x.id, x.name, x.p, x.q) for x in b.bodies if x.tracked] == [
            (x.id, x.name, x.p, x.q) for x in a.bodies if x.tracked
        ]


def test_frames_are_never_sent_before_their_time() -> None:
    sent = frames(40)

    class Sender:
        def send(self, frame: BodyFrame) -> None: ...

        def close(self) -> None: ...

    assert play(sent, Sender(), speed=4.0).seconds >= 39 / 240 / 4.0
    stopping = threading.Event()
    stopping.set()
    assert play(sent, Sender(), stopping=stopping).frames == 0


def test_a_loop_goes_on_rising() -> None:
    played = list(islice(looped(frames(5)), 17))
    assert [frame.frame for frame in played] == list(range(17))
    assert np.allclose(np.diff([frame.t_s for frame in played]), 1 / 240)
    assert played[5].bodies == played[0].bodies
    assert list(looped([])) == []


def test_a_large_frame_takes_several_bundles() -> None:
    receiving = Receiving("osc")
    sender = OscBodySender("127.0.0.1", int(receiving.url.rpartition(":")[2]))
    [sent] = frames(1, bodies=256)
    assert len(osc_datagrams(sent)) == 3
    sender.send(sent)
    assert len(receiving.heard.get(timeout=30.0).bodies) == 256
    sender.close()
    receiving.receiver.stop()


def test_names_that_fit_no_address() -> None:
    body = BodySample(None, "a/b", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), True)
    with pytest.raises(MessageError, match="'a/b' cannot be sent over OSC"):
        osc_datagrams(BodyFrame(0.0, 0, (body,), 0.0, "test"))


def test_nothing_receives(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("manipnet.inputs.playback.CONNECT_S", 0.2)
    receiving = Receiving("tcp")
    receiving.receiver.stop()
    with pytest.raises(PlayError, match="nothing receives bodies at tcp://127"):
        replay.connect(receiving.url)
    with pytest.raises(PlayError, match="nowhere"):
        OscBodySender("nowhere.invalid", 39540)


@pytest.mark.parametrize("url", ["127.0.0.1:5556", "udp://127.0.0.1:5556", "tcp://", "osc://host:99999"])
def test_the_address_to_play_to_is_checked(url: str) -> None:
    with pytest.raises(ValueError, match=r"tcp://HOST:PORT or osc://HOST:PORT|HOST or HOST:PORT"):
        replay.connect(url)


def short_take(start_s: float, seconds: float = 1.5, rate_hz: float = 120.0) -> Take:
    time_s = start_s + np.arange(round(seconds * rate_hz) + 1) / rate_hz
    performance = [scene(float(t - start_s)) for t in time_s]
    tracks = {name: [poses[name] for poses in performance] for name in performance[0]}
    seen = np.ones(len(time_s), dtype=np.bool_)
    return Take("short", rate_hz, time_s, {name: BodyTrack(np.array(poses), seen) for name, poses in tracks.items()})


@pytest.mark.parametrize("kind", ["tcp", "osc"])
def test_a_server_makes_hands_of_every_tick_of_a_take(
    stage: Stage, kind: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    stage.start_s += 1000.0
    take = short_take(stage.start_s)
    monkeypatch.setattr(replay, "read_take", lambda path, **_: take)
    address = stage.server.addresses["bodies" if kind == "tcp" else "osc"].partition("://")[2]
    assert cli.main(["replay", str(tmp_path), "--to", f"{kind}://{address}", "--speed", "0.5"]) == 0
    assert "sent 181 frames" in capsys.readouterr().err
    messages = [m for m in stage.subscriber.until(stage.start_s + 1.5) if m.t_capture >= stage.start_s - 1e-6]
    assert len(messages) == 91
    assert np.allclose(np.diff([m.t_capture for m in messages]), TICK_S)
    assert all(b.seq == a.seq + 1 for a, b in pairwise(messages))
    assert all(set(m.hands) == {"left", "right"} for m in messages)
    assert all(np.isfinite(hand.joints).all() for m in messages for hand in m.hands.values())


def test_another_rate_keeps_the_motion() -> None:
    take = short_take(0.0)
    half = replay.resample(take, 90.0)
    assert half.time_s[-1] == pytest.approx(1.5)
    assert len(half.time_s) == 136
    truth = np.array([scene(float(t))["Box"] for t in half.time_s])
    assert np.allclose(half.bodies["Box"].poses, truth, atol=1e-4)
    assert half.bodies["Box"].tracked.all()
    with pytest.raises(ValueError, match="--rate is 0"):
        replay.resample(take, 0.0)
