"""Every control of the live page, clicked in a real browser, and what the server makes of it."""

import tomllib
from collections.abc import Callable

import numpy as np
import pytest
from studio import BOX, PATIENCE_S, T_CLUSTER_WRIST, WRISTS, Studio, pose_of

from manipnet.actors.calibration import difference
from manipnet.geometry import Side
from manipnet.page.overlays import OVERLAYS
from manipnet.wire import HandsMessage


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
