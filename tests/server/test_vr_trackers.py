"""Two pucks on the wrists and one on a prop: SteamVR's poses come over VMC into a real server, without Motive."""

import itertools
import math
import random
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from live_server import LiveServer, Subscriber, scene, serving
from osc_writer import bundle, osc

from manipnet.actors.calibration import difference, sheet_at, wrist_on_sheet
from manipnet.geometry import SIDES, Array, Side, compose, invert, quat_exp
from manipnet.synthesis.objects.library import load_library_mesh
from manipnet.wire import HandsMessage

SERIALS = {"left_wrist": "LHR-1A2B3C4D", "right_wrist": "LHR-5E6F7081", "Box": "LHR-92A3B4C5"}
RIG = """
[bodies]
left_wrist = "LHR-1A2B3C4D"
right_wrist = "LHR-5E6F7081"
[[objects]]
body = "LHR-92A3B4C5"
name = "Box"
mesh = "cube"
[server]
look_ahead = 0.1
"""
NOISE_M = 3e-4
"""What a puck that lies still trembles."""
BUSY = 0.7
"""The share of the hands that is live even on a machine that lets the sender wait for a tenth of a second at times."""
Scene = Callable[[float], Mapping[str, Any]]
Send = Callable[[int, float, dict[str, Array]], list[bytes]]


@pytest.fixture(scope="module")
def server(tiny_bundle, tmp_path_factory) -> Iterator[LiveServer]:
    rig = tmp_path_factory.mktemp("rig") / "rig.toml"
    rig.write_text(RIG)
    with serving("--rig", str(rig), "--model", str(tiny_bundle)) as server:
        yield server


def to_unity(pose: Array) -> tuple[float, ...]:
    x, y, z, qx, qy, qz, qw = map(float, pose)
    return -x, y, z, qx, -qy, -qz, qw


def vmc(k: int, t_s: float, pucks: dict[str, Array]) -> list[bytes]:
    """One bundle, as a program that reads OpenVR sends it: the headset, and each puck by its serial number."""
    headset = osc("/VMC/Ext/Hmd/Pos", "LHR-HEADSET", 0.0, 1.7, 0.3 + 1e-4 * (k % 3), 0.0, 0.0, 0.0, 1.0)
    trackers = [osc("/VMC/Ext/Tra/Pos", SERIALS[name], *to_unity(pose)) for name, pose in pucks.items()]
    return [bundle(osc("/VMC/Ext/OK", 1), osc("/VMC/Ext/T", t_s), headset, *trackers)]


def vmc_without_time(k: int, t_s: float, pucks: dict[str, Array]) -> list[bytes]:
    """One datagram for each puck, with scaled and unscaled poses, and no time."""
    return [
        bundle(
            osc("/VMC/Ext/Tra/Pos", SERIALS[name], *to_unity(1.1 * pose)),
            osc("/VMC/Ext/Tra/Pos/Local", SERIALS[name], *to_unity(pose)),
        )
        for name, pose in pucks.items()
    ]


class Pucks:
    """Sends pucks at `hz` with jitter: in capture, up to a third of a frame, and on the way, sometimes three frames."""

    def __init__(self, server: LiveServer, poses: Scene, hz: float, send: Send = vmc) -> None:
        self._address = ("127.0.0.1", int(server.addresses["osc"].rpartition(":")[2]))
        self._poses, self._hz, self._send = poses, hz, send
        self._stopping = threading.Event()
        self._random = random.Random(1)

    def run(self) -> None:
        """Send until it is stopped."""
        waiting: list[bytes] = []
        held_back = 0
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
            begin_s = time.monotonic()
            for k in itertools.count():
                t_s = (k + self._random.uniform(0.0, 0.3)) / self._hz
                if self._stopping.wait(max(begin_s + t_s - time.monotonic(), 0.0)):
                    return
                noise = np.array([*(self._random.gauss(0.0, NOISE_M) for _ in range(3)), 0.0, 0.0, 0.0, 0.0])
                pucks = {name: np.asarray(pose) + noise for name, pose in self._poses(t_s).items()}
                waiting += self._send(k, t_s, pucks)
                held_back = held_back - 1 if held_back else (2 if k % 20 == 19 else 0)
                if not held_back:
                    for datagram in waiting:
                        udp.sendto(datagram, self._address)
                    waiting.clear()

    @contextmanager
    def sending(self) -> Iterator[None]:
        """Send in a thread of its own."""
        thread = threading.Thread(target=self.run)
        thread.start()
        yield
        self._stopping.set()
        thread.join()


def messages_until(subscriber: Subscriber, fulfilled: Callable[[HandsMessage], bool]) -> list[HandsMessage]:
    """The messages up to the first that is as wanted."""
    messages = [subscriber.next()]
    while not fulfilled(messages[-1]):
        messages.append(subscriber.next())
    return messages


def is_live(message: HandsMessage, *sides: Side) -> bool:
    """Whether both hands are there, and those of `sides`, or both, are live."""
    return len(message.hands) == 2 and all(message.hands[side].state == "live" for side in sides or SIDES)


@contextmanager
def heard(server: LiveServer) -> Iterator[Subscriber]:
    subscriber = Subscriber(server.addresses["hands"])
    yield subscriber
    subscriber.close()


@pytest.mark.parametrize("hz", [60, 90, 120])
def test_hands_follow_pucks_at_every_rate_in_spite_of_jitter(server: LiveServer, hz: float) -> None:
    with heard(server) as subscriber, Pucks(server, scene, hz).sending():
        first = messages_until(subscriber, lambda m: is_live(m) and m.t_capture < 1.0)[-1]
        messages = messages_until(subscriber, lambda m: first.t_capture + 3.0 < m.t_capture < 10.0)
        status = server.ask({"op": "status"})
    assert np.all(np.diff([message.seq for message in messages]) == 1)
    assert np.allclose(np.diff([message.t_capture for message in messages]), 1 / 60)
    assert np.mean([is_live(message) for message in messages]) > BUSY
    away = [
        difference(message.hands[side].wrist, np.array(scene(message.t_capture)[f"{side}_wrist"]))
        for message in messages
        if message.t_capture > first.t_capture + 0.5  # until then the hands ease to where the wrists are
        for side in SIDES
    ]
    away_m, away_rad = np.median(away, axis=0)
    assert away_m < 3 * NOISE_M
    assert away_rad < math.radians(0.5)
    sender = next(each for each in status["osc"]["senders"].values() if each["age_s"] < 1.0)
    assert sender["clock"] == {"used": "/VMC/Ext/T", "set_aside": {}}


def test_pucks_without_a_time_go_by_their_arrival(server: LiveServer) -> None:
    with heard(server) as subscriber, Pucks(server, scene, 90.0, vmc_without_time).sending():
        messages_until(subscriber, is_live)
        messages = [subscriber.next() for _ in range(90)]
    assert np.mean([is_live(message) for message in messages]) > BUSY
    for side in SIDES:
        heights = [message.hands[side].wrist[1] for message in messages]
        assert heights == pytest.approx([1.0] * len(heights), abs=10 * NOISE_M), "the unscaled pose counts"


LOST_S = (1.5, 3.5)


def omitted(pose: Array) -> Array | None:
    return None


def frozen() -> Callable[[Array], Array]:
    kept: list[Array] = []

    def freeze(pose: Array) -> Array:
        kept.append(pose)
        return kept[0]

    return freeze


def at_the_origin(pose: Array) -> Array:
    return np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


@pytest.mark.parametrize("way", [omitted, frozen, at_the_origin])
def test_a_puck_that_is_lost_eases_its_hand_to_rest_and_comes_back(server: LiveServer, way) -> None:
    """A program leaves a lost puck out, repeats its last pose, or sends zeros."""
    change = way() if way is frozen else way

    def send(k: int, t_s: float, pucks: dict[str, Array]) -> list[bytes]:
        if LOST_S[0] <= t_s < LOST_S[1]:
            changed = change(pucks["left_wrist"])
            others = {name: pose for name, pose in pucks.items() if name != "left_wrist"}
            pucks = others if changed is None else {"left_wrist": changed, **others}
        return vmc(k, t_s, pucks)

    with heard(server) as subscriber, Pucks(server, scene, 90.0, send).sending():
        messages_until(subscriber, lambda m: is_live(m) and m.t_capture < 1.0)
        messages = messages_until(subscriber, lambda m: LOST_S[1] + 1.5 < m.t_capture < 100.0)
    assert np.mean([is_live(message, "right") for message in messages]) > BUSY
    tracked = [m for m in messages if not LOST_S[0] - 0.1 < m.t_capture < LOST_S[1] + 0.7]
    assert np.mean([is_live(message, "left") for message in tracked]) > BUSY
    lost = [m.hands["left"].state for m in messages if LOST_S[0] + 1.2 < m.t_capture < LOST_S[1] - 0.1]
    assert set(lost) == {"rest"}
    steps_m = np.linalg.norm(np.diff([m.hands["left"].wrist[:3] for m in messages], axis=0), axis=1)
    assert steps_m.max() < 0.03, "nothing jumps, not even when it comes back"


ON_PUCK = {
    "left_wrist": np.concatenate([[0.01, -0.04, 0.05], quat_exp(np.array([1.2, 0.3, -0.7]))]),
    "right_wrist": np.concatenate([[-0.02, -0.03, 0.06], quat_exp(np.array([-0.4, 2.1, 0.2]))]),
    "Box": np.concatenate([[0.0, -0.12, 0.02], quat_exp(np.array([0.1, -0.9, 0.3]))]),
}
"""Where wrists and prop are on their pucks."""


def on_the_sheet(t_s: float) -> dict[str, Array]:
    sheet = sheet_at(np.zeros(3), 0.0)
    wrists = {f"{side}_wrist": compose(sheet, wrist_on_sheet(side)) for side in SIDES}
    return {name: compose(pose, invert(ON_PUCK[name])) for name, pose in {**wrists, "Box": sheet}.items()}


def test_wrists_and_prop_are_calibrated_by_the_sheet(server: LiveServer) -> None:
    with heard(server) as subscriber, Pucks(server, on_the_sheet, 90.0).sending():
        first = messages_until(subscriber, lambda m: is_live(m) and m.t_capture < 1.0)[-1]
        messages_until(subscriber, lambda m: m.t_capture > first.t_capture + 2.5)
        answer = server.ask({"op": "calibrate", "step": "wrists", "store": False})
        assert answer.get("quality") == "good", answer
        for side in SIDES:
            hand = answer["hands"][f"{side}_wrist"]
            found = np.array([*hand["position"], *hand["rotation"]])
            away_m, away_rad = difference(found, ON_PUCK[f"{side}_wrist"])
            assert away_m < NOISE_M
            assert away_rad < math.radians(0.2)
        placed = server.ask({"op": "place_object", "body": "LHR-92A3B4C5", "on_sheet": True, "store": False})
        assert "error" not in placed, placed
        settled = messages_until(subscriber, lambda m: m.t_capture > first.t_capture + 5.0)[-1]
    for side in SIDES:
        away_m, away_rad = difference(
            settled.hands[side].wrist, compose(sheet_at(np.zeros(3), 0.0), wrist_on_sheet(side))
        )
        assert away_m < 3e-3
        assert away_rad < math.radians(1.0)
    box = next(body.pose for body in settled.bodies if body.name == "Box")
    half_m = -load_library_mesh("cube").vertices[:, 1].min()
    np.testing.assert_allclose(box[:3], [0.0, half_m, 0.0], atol=4 * NOISE_M)
