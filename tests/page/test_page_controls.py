"""Every control of the live page, clicked in a real browser, and what the server makes of it."""

import contextlib
import shutil
import threading
import time
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Page, browsing
from live_server import LiveServer, Sender, Subscriber, serving

from manipnet.actors.calibration import difference, sheet_at, wrist_on_sheet
from manipnet.geometry import Side, compose, invert, quat_exp
from manipnet.page.overlays import OVERLAYS
from manipnet.wire import HandsMessage

PATIENCE_S = 90.0
"""A browser that draws in software, on a busy machine."""
TEXT = "document.body.innerText"
RIG = """
bodies.left_wrist = "left_wrist"
bodies.right_wrist = "right_wrist"
[[objects]]
body = "Box"  # taped
mesh = "cube"
"""
WRISTS: dict[Side, np.ndarray] = {
    side: compose(sheet_at(np.zeros(3), 0.0), wrist_on_sheet(side)) for side in ("left", "right")
}
"""Where the wrists are: on the sheet, at the world's origin."""
T_CLUSTER_WRIST = np.concatenate([[0.02, 0.03, -0.01], quat_exp(np.array([0.4, -0.8, 0.3]))])
BOX = np.array([0.05, 0.1, 0.05, 0.0, 0.0, 0.0, 1.0])
DISABLED = "[...document.querySelectorAll('button')].find(one => one.textContent.trim() === '%s').disabled"
FOLLOWING = DISABLED % "Follow the hands"
SECOND = """(() => {
  const label = [...document.querySelectorAll('label')].find(one => one.textContent === 'Time, s');
  let row = label;
  while (!row.querySelector('input:not([type=hidden])')) row = row.parentElement;
  return row.querySelector('input:not([type=hidden])').value;
})()"""
STAGE = """(() => {
  const value = name => parseFloat(getComputedStyle(document.documentElement).getPropertyValue(name));
  const [left, top, width, height] = ['--mn-left', '--mn-top', '--mn-width', '--mn-height'].map(value);
  return [left + width / 2, top + height / 2];
})()"""
"""The middle of the stage."""
PLACE = """(() => {
  const value = name => parseFloat(getComputedStyle(document.documentElement).getPropertyValue(name));
  const place = ['--mn-left', '--mn-top', '--mn-width', '--mn-height'].map(value);
  return place.some(Number.isNaN) ? null : place;
})()"""
"""Left, top, width and height of the stage."""
COMPLAIN = """
window.complaints = [];
addEventListener('error', event => complaints.push(event.message));
console.error = (...words) => complaints.push(words.join(' '));
"""


class Studio:
    """A server with a rig, bodies that lie still, what it publishes, and its page in a browser."""

    def __init__(self, server: LiveServer, page: Page, rig: Path, takes: Path) -> None:
        self.server, self.page, self.rig, self.takes = server, page, rig, takes
        self.subscriber = Subscriber(server.addresses["hands"])

    def until(self, fulfilled: Callable[[HandsMessage], Any]) -> HandsMessage:
        """The first message from now on that is as wanted."""
        give_up_s = time.monotonic() + PATIENCE_S
        while not fulfilled(message := self.subscriber.next()):
            assert time.monotonic() < give_up_s, "it never came to this"
        return message

    def box(self) -> dict[str, Any]:
        """What the body Box carries, as the server says."""
        give_up_s = time.monotonic() + PATIENCE_S
        while "bodies" not in (answer := self.server.ask({"op": "objects"})):  # a busy machine refuses some
            assert time.monotonic() < give_up_s, answer
        return answer["bodies"]["actor"]["Box"]

    def disabled(self, button: str) -> bool:
        """Whether a button cannot be clicked."""
        return bool(self.page.evaluate(DISABLED % button))

    def says(self, text: str) -> None:
        """Wait until the page says so."""
        self.page.wait_for(f"{TEXT}.includes({text!r})", PATIENCE_S)


@contextlib.contextmanager
def lying_still(server: LiveServer) -> Iterator[None]:
    """Hands on the sheet and a box beside them, 120 times a second."""
    sender, ended = Sender(server.addresses["bodies"]), threading.Event()
    clusters = {f"{side}_wrist": compose(wrist, invert(T_CLUSTER_WRIST)) for side, wrist in WRISTS.items()}

    def send() -> None:
        frames = 0
        while not ended.wait(1.0 / 120.0):
            sender.send(frames / 120.0, {**clusters, "Box": BOX})  # type: ignore[arg-type]
            frames += 1

    thread = threading.Thread(target=send)
    thread.start()
    yield
    ended.set()
    thread.join()
    sender.close()


@pytest.fixture(scope="module")
def studio(tiny_bundle: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Studio]:
    if (chromium := shutil.which("chromium")) is None:
        pytest.skip("needs chromium: apt-get install chromium")
    folder = tmp_path_factory.mktemp("studio")
    rig, takes = folder / "stage.toml", folder / "takes"
    rig.write_text(RIG)
    options = ("--rig", str(rig), "--model", str(tiny_bundle), "--takes", str(takes))
    with (
        serving(*options) as server,
        lying_still(server),
        browsing(chromium, server.addresses["page"], folder / "profile") as page,
    ):
        page.call("Emulation.setDeviceMetricsOverride", width=1000, height=700, deviceScaleFactor=1, mobile=False)
        page.call("Page.enable")
        page.call("Page.addScriptToEvaluateOnNewDocument", source=COMPLAIN)
        page.call("Page.reload")
        studio = Studio(server, page, rig, takes)
        studio.says("hands/s")
        yield studio
        assert page.evaluate("window.complaints.join('; ') || 'none'") == "none"
        assert "page_ended" not in server.ask({"op": "status"})["counters"]
        studio.subscriber.close()


def test_pause_go_on_and_rest(studio: Studio) -> None:
    def are(state: str) -> Callable[[HandsMessage], bool]:
        return lambda message: {hand.state for hand in message.hands.values()} == {state}

    studio.until(are("live"))
    studio.page.click("Pause")
    studio.until(are("hold"))
    studio.says("Paused")
    studio.page.click("Resume", PATIENCE_S)
    studio.until(are("live"))
    studio.page.click("Rest")
    studio.until(are("rest"))
    studio.until(are("live"))


def test_look_ahead_and_layers(studio: Studio) -> None:
    studio.page.type("Look-ahead, ms", "100")
    studio.until(lambda message: message.look_ahead == pytest.approx(0.1))
    studio.says("100 ms look-ahead")
    for layer in OVERLAYS.values():
        studio.page.tick(layer.label)
    shown = studio.server.ask({"op": "status"})["counters"]["page_frames"]["shown"]
    while studio.server.ask({"op": "status"})["counters"]["page_frames"]["shown"] < shown + 10:
        studio.subscriber.next()
    for layer in OVERLAYS.values():
        studio.page.tick(layer.label)


def test_an_object_is_chosen_sized_and_placed(studio: Studio) -> None:
    box = studio.box
    studio.page.click("Objects")
    studio.page.wait_for("[...document.querySelectorAll('input')].some(one => one.value === 'Box')", PATIENCE_S)
    studio.page.choose("Object", "sphere")
    studio.until(lambda _: box()["object"] == "sphere")
    studio.page.type("Size", "1.5")
    studio.until(lambda _: box()["scale"] == 1.5)
    studio.page.type("Position, mm", "40", number=1)
    moved = studio.until(lambda message: pose_of(message, "Box")[1] > BOX[1] + 0.03)
    np.testing.assert_allclose(pose_of(moved, "Box")[:3], BOX[:3] + np.array([0.0, 0.04, 0.0]), atol=1e-9)
    studio.page.type("Rotation, °", "90", number=1)
    studio.until(lambda message: abs(pose_of(message, "Box")[4]) > 0.7)
    studio.page.tick("Drag to move")
    (kept,) = tomllib.loads(studio.rig.read_text())["objects"]
    np.testing.assert_allclose(kept["position"], [0.0, 0.04, 0.0])
    studio.page.click("The object is on the sheet")
    placed = studio.until(lambda message: abs(pose_of(message, "Box")[0]) < 1e-6)
    np.testing.assert_allclose(pose_of(placed, "Box")[2:], [0.0, 0.0, 0.0, 0.0, 1.0], atol=1e-6)


def test_changes_are_undone_reset_and_saved(studio: Studio) -> None:
    studio.page.click("Objects")
    studio.page.wait_for("[...document.querySelectorAll('input')].some(one => one.value === 'Box')", PATIENCE_S)
    before = studio.box()
    studio.page.choose("Object", "torus")
    studio.until(lambda _: studio.box()["object"] == "torus")
    studio.says("Box (torus)")
    studio.page.click("Undo")
    studio.until(lambda _: studio.box() == before)
    studio.page.choose("Object", "hammer")
    studio.until(lambda _: studio.box()["object"] == "hammer")
    studio.page.click("Save to the rig file")
    studio.says("saved in")
    assert tomllib.loads(studio.rig.read_text())["objects"][0]["mesh"] == "hammer"
    assert "# taped" in studio.rig.read_text()
    studio.page.click("Reset")
    studio.until(lambda _: studio.box()["object"] == "cube")


def test_wrists_are_calibrated_and_the_quality_is_told(studio: Studio) -> None:
    studio.page.click("Calibrate")
    studio.page.click("The hands are on the marks")
    studio.says("Good: the hands are 1.000 times")
    studio.says("stored in stage.toml")
    studio.until(lambda message: all(is_there(message, side) for side in WRISTS))  # eased there, not at once
    kept = tomllib.loads(studio.rig.read_text())["bodies"]["left_wrist"]
    found = np.array([*kept["position"], *kept["rotation"]])
    assert difference(found, T_CLUSTER_WRIST)[0] < 1e-6


def is_there(message: HandsMessage, side: Side) -> bool:
    """Whether a hand is where its wrist is."""
    away_m, away_rad = difference(message.hands[side].wrist, WRISTS[side])
    return away_m < 2e-3 and away_rad < np.radians(1.0)


def pose_of(message: HandsMessage, name: str) -> np.ndarray:
    return next(body.pose for body in message.bodies if body.name == name)
