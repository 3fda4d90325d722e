"""A server with a rig and bodies that lie still, and its page in a browser, for tests of the page's controls."""

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

from manipnet.actors.calibration import sheet_at, wrist_on_sheet
from manipnet.geometry import Side, compose, invert, quat_exp
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
TABS = """(() => {
  const tabs = [...document.querySelectorAll('[role=tab]')].filter(one => one.offsetParent);
  return tabs.length > 4 && tabs.map(one => Object.values(one.getBoundingClientRect().toJSON()).join()).join();
})()"""
"""Where the tabs are; false before all are there."""
OPENED = """[...document.querySelectorAll('[role=tab]')].some(
  one => one.textContent.trim() === '%s' && one.getAttribute('aria-selected') === 'true')"""
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
DISMISS = "document.querySelectorAll('.mantine-Notification-closeButton').forEach(button => button.click())"
"""Removes the notifications, which cover part of the stage."""
COMPLAIN = """
window.complaints = [];
// A resize that is only reported in the next frame, as on a busy machine, is an event of this kind too, but no error.
addEventListener('error', event => event.message.startsWith('ResizeObserver loop') || complaints.push(event.message));
console.error = (...words) => complaints.push(words.join(' '));
"""


class Studio:
    """A server with a rig, bodies that lie still, what it publishes, and its page in a browser."""

    def __init__(self, server: LiveServer, page: Page, rig: Path, takes: Path, bodies: dict[str, np.ndarray]) -> None:
        """`bodies` are the poses that are sent; a test may change them."""
        self.server, self.page, self.rig, self.takes, self.bodies = server, page, rig, takes, bodies
        self.subscriber = Subscriber(server.addresses["hands"])

    def until(self, fulfilled: Callable[[HandsMessage], Any]) -> HandsMessage:
        """The first message from now on that is as wanted."""
        give_up_s = time.monotonic() + PATIENCE_S
        while not fulfilled(message := self.subscriber.next()):
            assert time.monotonic() < give_up_s, "it never came to this"
        return message

    def settle(self, seconds: float = 0.3) -> None:
        """Let the server's clock go on a little, in which the browser sends what was typed."""
        end_s = self.server.ask({"op": "status"})["uptime_s"] + seconds
        while self.server.ask({"op": "status"})["uptime_s"] < end_s:
            pass

    def box(self) -> dict[str, Any]:
        """What the body Box carries, as the server says."""
        give_up_s = time.monotonic() + PATIENCE_S
        while "bodies" not in (answer := self.server.ask({"op": "objects"})):  # a busy machine refuses some
            assert time.monotonic() < give_up_s, answer
        return answer["bodies"]["actor"]["Box"]

    def kept_place(self) -> list[float]:
        """Where the rig file says that the object sits on the body Box."""
        return tomllib.loads(self.rig.read_text())["objects"][0].get("position", [0.0, 0.0, 0.0])

    def red_arrow(self) -> tuple[float, float]:
        """Where on the page the arrow along x is that moves an object."""
        self.page.evaluate(DISMISS)
        left, top, width, height = self.page.wait_for(PLACE)
        give_up_s = time.monotonic() + PATIENCE_S
        while True:
            stage = self.page.picture()[int(top) : int(top + height), int(left) : int(left + width)]
            red, green, blue = stage.transpose(2, 0, 1)
            rows, columns = np.nonzero((red > green + 60) & (red > blue + 40))
            if len(columns) > 200 and columns.max() > width / 2:
                tip = columns.argmax()
                return left + columns[tip] - 8.0, float(top + rows[tip])
            assert time.monotonic() < give_up_s, "no arrow is drawn"

    def wait_until_it_stands(self) -> None:
        """Wait until a page that was just loaded is live and moves no more: a click during that hits something else."""
        self.page.wait_for(f"window.complaints && {TEXT}.includes('hands/s')", PATIENCE_S)
        place, before = self.page.wait_for(TABS, PATIENCE_S), None
        while place != before:
            time.sleep(1.0)
            place, before = self.page.wait_for(TABS, PATIENCE_S), place

    def open(self, tab: str) -> None:
        """Open a tab of the panel, clicking again if the panel was moving under the mouse."""
        opened, give_up_s = OPENED % tab, time.monotonic() + PATIENCE_S
        while not self.page.evaluate(opened):
            assert time.monotonic() < give_up_s, f"the tab {tab} does not open"
            self.page.click(tab, PATIENCE_S)
            with contextlib.suppress(AssertionError):
                self.page.wait_for(opened, 1.0)

    def disabled(self, button: str) -> bool:
        """Whether a button cannot be clicked."""
        return bool(self.page.evaluate(DISABLED % button))

    def says(self, text: str) -> None:
        """Wait until the page says so."""
        self.page.wait_for(f"{TEXT}.includes({text!r})", PATIENCE_S)


def clusters_of(wrists: dict[Side, np.ndarray]) -> dict[str, np.ndarray]:
    """The bodies on which these wrists sit."""
    return {f"{side}_wrist": compose(wrist, invert(T_CLUSTER_WRIST)) for side, wrist in wrists.items()}


@contextlib.contextmanager
def lying_still(server: LiveServer) -> Iterator[dict[str, np.ndarray]]:
    """Hands on the sheet and a box beside them, 120 times a second; yields their poses, which may be changed."""
    sender, ended = Sender(server.addresses["bodies"]), threading.Event()
    bodies = {**clusters_of(WRISTS), "Box": BOX}

    def send() -> None:
        frames = 0
        while not ended.wait(1.0 / 120.0):
            sender.send(frames / 120.0, dict(bodies))
            frames += 1

    thread = threading.Thread(target=send)
    thread.start()
    yield bodies
    ended.set()
    thread.join()
    sender.close()


@contextlib.contextmanager
def studio_in(folder: Path, model: Path, rig_text: str = RIG) -> Iterator[Studio]:
    """A server that keeps its rig and takes in `folder`, and its page. Skips the test where there is no Chromium."""
    if (chromium := shutil.which("chromium")) is None:
        pytest.skip("needs chromium: apt-get install chromium")
    rig, takes = folder / "stage.toml", folder / "takes"
    rig.write_text(rig_text)
    options = ("--rig", str(rig), "--model", str(model), "--takes", str(takes))
    with (
        serving(*options) as server,
        lying_still(server) as bodies,
        browsing(chromium, server.addresses["page"], folder / "profile") as page,
    ):
        page.call("Emulation.setDeviceMetricsOverride", width=1000, height=700, deviceScaleFactor=1, mobile=False)
        page.call("Page.enable")
        page.call("Page.addScriptToEvaluateOnNewDocument", source=COMPLAIN)
        page.call("Page.reload")
        studio = Studio(server, page, rig, takes, bodies)
        studio.wait_until_it_stands()
        yield studio
        complaints = page.evaluate("window.complaints.join('; ') || 'none'")
        assert complaints == "none", complaints
        assert "page_ended" not in server.ask({"op": "status"})["counters"]
        studio.subscriber.close()


def pose_of(message: HandsMessage, name: str) -> np.ndarray:
    return next(body.pose for body in message.bodies if body.name == name)
