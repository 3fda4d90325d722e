"""Every control of the live page, clicked in a real browser, and what the server makes of it."""

import tomllib
from collections.abc import Callable

import numpy as np
import pytest
from studio import BOX, PATIENCE_S, T_CLUSTER_WRIST, WRISTS, Studio, clusters_of, pose_of

from manipnet.actors.calibration import HAND_LENGTH_M, MARK_M, difference
from manipnet.geometry import Side
from manipnet.page.overlays import OVERLAYS
from manipnet.wire import HandsMessage

RECORD_TOP = """
[...document.querySelectorAll('button')].find(one => one.textContent.trim() === 'Record').getBoundingClientRect().top"""
CORNERS = [(x, y, z) for x in (-2, 2) for y in (-6, 6) for z in (-2, 2)]
SIDES = ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4")
PESTLE = "".join([*(f"v {x} {y} {z}\n" for x, y, z in CORNERS), *(f"f {side}\n" for side in SIDES)])
"""A stick as an OBJ file, in centimetres."""


def test_pause_go_on_and_rest(studio: Studio) -> None:
    def are(state: str) -> Callable[[HandsMessage], bool]:
        return lambda message: {hand.state for hand in message.hands.values()} == {state}

    studio.until(are("live"))
    top = studio.page.evaluate(RECORD_TOP)
    studio.page.click("Pause")
    studio.until(are("hold"))
    studio.says("Paused")
    assert studio.page.evaluate(RECORD_TOP) == top, "buttons must not move under the mouse when the state changes"
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
    studio.open("Objects")
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
    studio.until(lambda _: np.allclose(studio.kept_place(), [0.0, 0.04, 0.0]))
    studio.page.click("The object is on the sheet")
    placed = studio.until(lambda message: abs(pose_of(message, "Box")[0]) < 1e-6)
    np.testing.assert_allclose(pose_of(placed, "Box")[2:], [0.0, 0.0, 0.0, 0.0, 1.0], atol=1e-6)


def test_an_object_is_dragged_in_the_scene(studio: Studio) -> None:
    studio.open("Objects")
    studio.page.wait_for("[...document.querySelectorAll('input')].some(one => one.value === 'Box')", PATIENCE_S)
    studio.page.choose("Body", "Box")
    before = np.array(studio.box()["position"])
    studio.page.tick("Drag to move")
    x, y = studio.red_arrow()
    studio.page.drag((x, y), (x + 40, y))
    studio.until(lambda _: studio.box()["position"][0] > before[0] + 0.005)
    studio.until(lambda _: np.allclose(studio.kept_place(), studio.box()["position"], atol=1e-5))
    np.testing.assert_allclose(studio.box()["position"][1:], before[1:], atol=1e-6)  # along the arrow and nowhere else
    studio.page.click("Undo")
    studio.until(lambda _: np.allclose(studio.box()["position"], before))
    studio.page.tick("Drag to move")


def test_a_mesh_is_imported_with_the_button(studio: Studio) -> None:
    studio.open("Objects")
    studio.page.wait_for("[...document.querySelectorAll('input')].some(one => one.value === 'Box')", PATIENCE_S)
    studio.page.choose("Unit of the file", "cm")
    mesh = studio.rig.parent / "pestle.obj"
    mesh.write_text(PESTLE)
    studio.page.give_file(mesh)
    studio.until(lambda _: studio.box()["object"] == "pestle")
    studio.says("Box carries pestle")
    studio.page.choose("Unit of the file", "m")


def test_changes_are_undone_reset_and_saved(studio: Studio) -> None:
    studio.open("Objects")
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


def test_wrists_and_the_size_of_hands_are_calibrated_and_the_quality_is_told(studio: Studio) -> None:
    studio.bodies["Box"] = np.array([0.0, 0.03, 0.0, 0.0, 0.0, 0.0, 1.0])  # half of it is above the sheet's centre
    studio.until(lambda message: pose_of(message, "Box")[0] == 0.0)
    studio.open("Calibrate")
    studio.page.choose("Sheet position", "under Box")
    studio.page.click("The hands are on the marks")
    studio.says("Good: the hands are 1.000 times")
    studio.says("stored in stage.toml")
    studio.until(lambda message: all(is_there(message, side) for side in WRISTS))  # eased there, not at once
    kept = tomllib.loads(studio.rig.read_text())["bodies"]["left_wrist"]
    found = np.array([*kept["position"], *kept["rotation"]])
    assert difference(found, T_CLUSTER_WRIST)[0] < 1e-6
    back = np.array([0.0, 0.0, 1.05 * HAND_LENGTH_M - MARK_M[1], 0.0, 0.0, 0.0, 0.0])
    studio.bodies.update(clusters_of({side: wrist + back for side, wrist in WRISTS.items()}))
    studio.page.choose("Sheet position", "at the world's origin")
    studio.page.click("The fingertips touch the line")
    studio.says("the hands are 1.050 times")
    assert tomllib.loads(studio.rig.read_text())["hand_scale"] == pytest.approx(1.05)


def is_there(message: HandsMessage, side: Side) -> bool:
    """Whether a hand is where its wrist is."""
    away_m, away_rad = difference(message.hands[side].wrist, WRISTS[side])
    return away_m < 2e-3 and away_rad < np.radians(1.0)
