"""Every control of the live page, clicked in a real browser, and what the server makes of it."""

import contextlib
import json
import shutil
import threading
import time
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Page, another, browsing
from live_server import LiveServer, Sender, Subscriber, serving

from manipnet.actors.calibration import difference, sheet_at, wrist_on_sheet
from manipnet.geometry import Side, compose, invert, quat_exp, transform
from manipnet.page.frames import Frame
from manipnet.page.framing import FIELD_OF_VIEW_RAD, UP, Focus, camera_position, focus_of
from manipnet.page.overlays import OVERLAYS
from manipnet.recording.mcap_file import read_hands
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


def test_the_gizmo_moves_the_object_on_its_body(studio: Studio) -> None:
    page = studio.page
    page.click("Objects")
    page.tick("Drag to move")
    page.key("c")  # the camera frames what happens
    before = studio.box()["position"]
    message = studio.until(lambda message: len(message.hands) == 2)
    focus = focus_of([Frame(message, (), {}, {})])
    assert focus is not None
    prop = pose_of(message, "Box")
    x, y, width, height = page.wait_for(f"{PLACE}", PATIENCE_S)
    start, end = (
        on_screen(focus, transform(prop, np.array([along_m, 0.0, 0.0])), width, height) for along_m in (0.1, 0.16)
    )
    page.drag((x + start[0], y + start[1]), (x + end[0], y + end[1]))
    studio.until(lambda _: studio.box()["position"][0] > before[0] + 0.02)
    page.click("Objects")
    page.click("Undo")
    studio.until(lambda _: studio.box()["position"] == pytest.approx(before, abs=1e-6))
    page.tick("Drag to move")


def on_screen(focus: Focus, point: np.ndarray, width: float, height: float) -> tuple[float, float]:
    """Where a point of the world is on the stage, in pixels, seen by the camera that follows."""
    position = camera_position(focus, width / height)
    forward = focus.center - position
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, UP)
    right /= np.linalg.norm(right)
    away = point - position
    scale = 0.5 * height / np.tan(0.5 * FIELD_OF_VIEW_RAD) / (away @ forward)
    return 0.5 * width + scale * (away @ right), 0.5 * height - scale * (away @ np.cross(right, forward))


def test_a_take_is_recorded_with_keys_and_shown_to_one_visitor_only(studio: Studio) -> None:
    page = studio.page
    page.click("Takes")
    page.type("Slate", "12A")
    studio.says("Record makes: 12A take 1")
    page.key("r")  # it is typed into no field
    page.wait_for("document.querySelector('.mn-recording') !== null", PATIENCE_S)
    studio.says("REC 0:0")
    page.wait_for("document.body.innerText.includes('Stop recording 0:0')", PATIENCE_S)
    page.key("r")
    page.wait_for("document.querySelector('.mn-recording') === null", PATIENCE_S)
    page.wait_for("[...document.querySelectorAll('input')].some(one => one.value === '12A take 1.mcap')", PATIENCE_S)
    take = studio.takes / "12A take 1.mcap"
    assert sum(1 for _ in read_hands(take)) > 0
    studio.says("Record makes: 12A take 2")
    page.click("Show this take")
    studio.says(f"▶ {take.name}")
    with another(page) as other:
        other.wait_for(f"{TEXT}.includes('● Live')", PATIENCE_S)
        assert not other.evaluate(f"{TEXT}.includes('Back to live')")
    page.type("Time, s", "0.02")
    page.click("Play")
    page.wait_for(f"{TEXT}.includes('Pause playback')", PATIENCE_S)
    page.key(" ")
    page.wait_for(f"!{TEXT}.includes('Pause playback')", PATIENCE_S)
    page.type("Time, s", "0")
    page.key("ArrowRight")
    page.wait_for(f"{SECOND} === '0.02'", PATIENCE_S)
    page.key("ArrowLeft")
    page.wait_for(f"{SECOND} === '0'", PATIENCE_S)
    page.click("Back to live")
    studio.says("● Live")
    page.click("Show this take")
    studio.says(f"▶ {take.name}")
    page.call("Page.reload")
    studio.says("● Live")


def test_keys_do_nothing_while_somebody_types(studio: Studio) -> None:
    page = studio.page
    page.click("Takes")
    page.wait_for("[...document.querySelectorAll('input')].some(one => one.value.startsWith('12A take 1'))", PATIENCE_S)
    page.type("Note", "ran r r", field="textarea", enter=False)
    page.key("r")
    page.click("Takes")  # the text is kept when its field is left
    studio.says("note is kept")
    assert studio.server.ask({"op": "recordings"})["recording"] is None


def test_a_take_is_described_downloaded_renamed_and_deleted(studio: Studio) -> None:
    page = studio.page
    page.click("Takes")
    page.type("Name", "best of all")
    studio.until(lambda _: (studio.takes / "best of all.mcap").exists())
    notes = json.loads((studio.takes / "best of all.json").read_text())
    assert notes == {"slate": "12A", "number": 1, "note": "ran r rr"}
    page.call("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(studio.rig.parent))
    page.click("Download")
    copy = studio.rig.parent / "best of all.mcap"
    studio.until(lambda _: copy.exists() and copy.stat().st_size == (studio.takes / copy.name).stat().st_size)
    page.click("Delete …")
    page.click("Keep it", PATIENCE_S)
    page.click("Delete …")
    page.click("Delete it", PATIENCE_S)
    studio.until(lambda _: not list(studio.takes.iterdir()))


def test_the_camera_is_taken_and_given_back(studio: Studio) -> None:
    page = studio.page
    page.click("View")
    page.wait_for(f"{FOLLOWING}", PATIENCE_S)
    x, y = page.evaluate(STAGE)
    page.drag((x, y + 120), (x + 90, y + 150))
    page.wait_for(f"!{FOLLOWING}", PATIENCE_S)
    page.click("Follow the hands")
    page.wait_for(f"{FOLLOWING}", PATIENCE_S)


def test_the_theme_is_light_or_dark_and_remembered(studio: Studio) -> None:
    page, scheme = studio.page, "document.documentElement.dataset.mantineColorScheme"
    page.click("View")
    page.wait_for(f"{scheme} === 'dark'", PATIENCE_S)
    page.click("Light theme")
    page.wait_for(f"{scheme} === 'light'", PATIENCE_S)
    page.call("Page.reload")
    page.wait_for(f"{scheme} === 'light'", PATIENCE_S)
    page.click("Dark theme", PATIENCE_S)
    page.wait_for(f"{scheme} === 'dark'", PATIENCE_S)


def test_a_tablet_shows_stage_and_controls_side_by_side(studio: Studio) -> None:
    page = studio.page
    page.call("Emulation.setDeviceMetricsOverride", width=768, height=1024, deviceScaleFactor=1, mobile=True)
    page.call("Page.reload")
    studio.says("● Live")
    page.wait_for(f"({STAGE})[0] > 0 && innerWidth === 768", PATIENCE_S)
    width = page.wait_for("parseFloat(getComputedStyle(document.documentElement).getPropertyValue('--mn-width'))")
    assert width > 350
    assert page.evaluate("document.documentElement.scrollWidth") == 768
    page.click("Takes", PATIENCE_S)
    page.wait_for(f"{TEXT}.includes('Record makes')", PATIENCE_S)
    page.call("Emulation.setDeviceMetricsOverride", width=1000, height=700, deviceScaleFactor=1, mobile=False)
    page.call("Page.reload")
    studio.says("● Live")


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
