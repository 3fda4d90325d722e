"""The requests calibrate and place_object without a server: on an actor whose hands were shown, and a rig file."""

import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from manipnet.actors.actor import Actor
from manipnet.actors.calibration import difference, wrist_on_sheet
from manipnet.config.rig_reader import load_rig
from manipnet.control.actors_proxy import ActorsProxy
from manipnet.control.calibration_requests import CalibrationRequests
from manipnet.control.request import RequestError
from manipnet.geometry import compose, invert, quat_exp
from manipnet.runtime.mailbox import Mailbox
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.telemetry import Telemetry
from manipnet.wire.bodies import BodyFrame, BodySample

HAND = shipped_hand()

RIG = '# mine\n[bodies]\nleft_wrist = "left_wrist"  # taped\nright_wrist = "right_wrist"\n'
CLUSTER = np.concatenate([[0.03, 0.02, -0.01], quat_exp(np.array([1.0, -2.0, 0.5]))])
SEEN_HZ = 120
NOW_S = 500.0


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    path = tmp_path / "rig.toml"
    path.write_text(RIG, encoding="utf-8")
    return path


@pytest.fixture
def actors_proxy(rig: Path) -> Iterator[ActorsProxy]:
    bundle = SimpleNamespace(hand=HAND, rest_angles=np.zeros(HAND.angle_count), limits=HAND.limits)
    mailbox, stop = Mailbox(Telemetry()), threading.Event()

    def tick() -> None:
        while not stop.is_set():
            mailbox.wait(0.01)

    thread = threading.Thread(target=tick)
    thread.start()
    yield ActorsProxy([Actor(load_rig(rig).actors[0], [], bundle, Telemetry(), 0.0)], mailbox)  # pyright: ignore
    stop.set()
    thread.join()


def show(actors_proxy: ActorsProxy, drift_m_s: float = 0.0) -> None:
    """Both hands on a sheet at the origin for the two seconds before now."""
    rng = np.random.default_rng(1)
    for i in range(-2 * SEEN_HZ - 30, 1):
        samples = []
        for side in ("left", "right"):
            pose = compose(wrist_on_sheet(side), invert(CLUSTER))
            p = pose[:3] + rng.normal(0.0, 5e-4, 3) + [drift_m_s * i / SEEN_HZ, 0.0, 0.0]
            samples.append(BodySample(None, f"{side}_wrist", tuple(p), tuple(pose[3:]), True))
        actors_proxy.actors[0].push(BodyFrame(10.0 + i / SEEN_HZ, i, tuple(samples), NOW_S + i / SEEN_HZ, "zmq:test"))


def test_a_calibration_is_in_force_and_stored_and_the_next_one_changes_little(
    actors_proxy: ActorsProxy, rig: Path
) -> None:
    calibrate = CalibrationRequests(actors_proxy, rig, lambda: NOW_S).handlers()["calibrate"]
    show(actors_proxy)
    answer = calibrate({"op": "calibrate"})
    assert answer["stored"] == str(rig)
    for side in ("left", "right"):
        role = f"{side}_wrist"
        for offset in (actors_proxy.actors[0].offset(role), load_rig(rig).actors[0].wrists[role].offset):
            assert offset is not None
            away_m, away_rad = difference(offset, CLUSTER)
            assert away_m < 1e-3
            assert away_rad < np.radians(0.5)
    assert "# taped" in rig.read_text(encoding="utf-8")
    again = calibrate({"op": "calibrate", "hand": "left", "store": False})
    assert again["hands"]["left_wrist"]["changed_mm"] < 0.01
    assert set(again["hands"]) == {"left_wrist"}


def test_a_hand_that_moved_changes_nothing(actors_proxy: ActorsProxy, rig: Path) -> None:
    show(actors_proxy, drift_m_s=0.01)
    with pytest.raises(RequestError, match=r"left_wrist moved .* lay the hand down and try again"):
        CalibrationRequests(actors_proxy, rig, lambda: NOW_S).handlers()["calibrate"]({"op": "calibrate"})
    assert rig.read_text(encoding="utf-8") == RIG
    assert np.array_equal(actors_proxy.actors[0].offset("left_wrist"), [0, 0, 0, 0, 0, 0, 1])


def test_without_a_rig_file_it_lasts_until_the_server_stops(actors_proxy: ActorsProxy) -> None:
    show(actors_proxy)
    answer = CalibrationRequests(actors_proxy, None, lambda: NOW_S).handlers()["calibrate"]({"op": "calibrate"})
    assert answer["stored"] is None
    assert "started without --rig" in answer["note"]
