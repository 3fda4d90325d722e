"""Calibration on a real server: it is in force at once and stored in the rig file, or refused with the reason."""

import tomllib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from live_server import Stage, scene, serving

from manipnet.actors.calibration import HAND_LENGTH_M, MARK_M, difference, sheet_at, wrist_on_sheet
from manipnet.geometry import Array, compose, invert, quat_exp
from manipnet.wire import Side

RIG = """# stage two
[bodies]
left_wrist = "left_wrist"   # the taped one
right_wrist = 2

[[objects]]
body = "Box"
mesh = "cube"
"""
SIDES: dict[Side, str | int] = {"left": "left_wrist", "right": 2}
CLUSTERS = {
    "left": np.concatenate([[0.03, 0.02, -0.01], quat_exp(np.array([1.0, -2.0, 0.5]))]),
    "right": np.concatenate([[-0.05, 0.04, 0.02], quat_exp(np.array([0.3, 1.0, 2.0]))]),
}
"""T_cluster_wrist of the two hands."""
SHEET = sheet_at(np.array([0.2, 0.75, 0.1]), 0.3)
SHEET_SAID = [0.2, 0.75, 0.1, 0.3]


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    path = tmp_path / "rig.toml"
    path.write_text(RIG, encoding="utf-8")
    return path


@pytest.fixture
def stage(tiny_bundle: Path, rig: Path) -> Iterator[Stage]:
    with serving("--rig", str(rig), "--model", str(tiny_bundle)) as server:
        stage = Stage(server)
        yield stage
        stage.close()


def clusters_of(wrists: dict[Side, Array], t_s: float) -> dict[str | int, Array]:
    """The tracked clusters of two wrists, within the noise of a tracker."""
    rng = np.random.default_rng(round(1e4 * t_s))
    noise = np.concatenate([rng.normal(0.0, 5e-4, 3), quat_exp(rng.normal(0.0, 0.01, 3))])
    return {SIDES[side]: compose(compose(wrist, invert(CLUSTERS[side])), noise) for side, wrist in wrists.items()}


def shown(scale: float = 1.0, back: float = 0.0) -> dict[Side, Array]:
    """Both wrists on the sheet, or drawn `back` from their marks."""
    away = np.array([0.0, 0.0, back, 0.0, 0.0, 0.0, 0.0])
    return {side: compose(SHEET, wrist_on_sheet(side, scale) + away) for side in SIDES}


def ask_while(stage: Stage, wrists: dict[Side, Array], **request) -> dict:
    """The answer to a request made after the hands were held still for two seconds."""
    answer = {}

    def poses(t_s: float):
        if t_s == 2.25:
            answer.update(stage.server.ask(request))
        return {**clusters_of(wrists, t_s), "Box": compose(SHEET, np.array([0.01, 0.05, 0.0, 0, 0, 0, 1.0]))}

    messages = stage.perform(2.5, poses)
    assert len(messages) == 151, "no tick is missing"
    return answer


def test_a_calibration_is_in_force_at_once_and_stored(stage: Stage, rig: Path) -> None:
    answer = ask_while(stage, shown(0.9), op="calibrate", sheet=SHEET_SAID, hand_length=0.9 * HAND_LENGTH_M)
    assert answer["hand_scale"] == pytest.approx(0.9)
    assert answer["quality"] == "fair", "half a millimetre and half a degree of noise"
    for side in SIDES:
        hand = answer["hands"][f"{side}_wrist"]
        away_m, away_rad = difference(np.array(hand["position"] + hand["rotation"]), CLUSTERS[side])
        assert away_m < 2e-3
        assert away_rad < np.radians(1.0)
        assert 0.5 < hand["spread_mm"] < 1.5
        assert hand["samples"] == pytest.approx(240, abs=5)
    true: dict[Side, Array] = {side: np.array(scene(0.0)[f"{side}_wrist"]) for side in SIDES}
    message = stage.perform(0.5, lambda t: {**clusters_of(true, t), "Box": scene(t)["Box"]})[-1]
    for side in SIDES:
        away_m, away_rad = difference(message.hands[side].wrist, true[side])
        assert away_m < 4e-3, "one sample of noise"
        assert away_rad < np.radians(3.0)
        assert message.hands[side].scale == pytest.approx(0.9)
    assert answer["stored"] == str(rig)
    text = rig.read_text(encoding="utf-8")
    assert "# the taped one" in text
    assert tomllib.loads(text)["bodies"]["right_wrist"]["body"] == 2
    assert tomllib.loads(text)["hand_scale"] == pytest.approx(0.9)
    assert (rig.parent / "rig.toml.bak").read_text(encoding="utf-8") == RIG


def test_a_touch_measures_the_hands_a_prop_places_the_sheet_and_an_object_is_placed(stage: Stage, rig: Path) -> None:
    placed = ask_while(stage, {}, op="place_object", body="Box", on_sheet=True, sheet=SHEET_SAID)
    assert placed["position"] == pytest.approx([-0.01, -0.02, 0.0], abs=1e-6)  # the cube's bottom is 3 cm down
    first = ask_while(stage, shown(1.1), op="calibrate", reference="Box", hand="both")
    assert "hands" in first, first
    answer = ask_while(
        stage, shown(1.1, 1.1 * HAND_LENGTH_M - MARK_M[1]), op="calibrate", step="fingertips", reference="Box"
    )
    assert answer["hand_scale"] == pytest.approx(1.1, abs=0.01)
    for side in SIDES:
        hand = answer["hands"][f"{side}_wrist"]
        away_m, _ = difference(np.array(hand["position"] + hand["rotation"]), CLUSTERS[side])
        assert away_m < 2e-3
    stored = tomllib.loads(rig.read_text(encoding="utf-8"))
    assert stored["objects"][0]["position"] == pytest.approx([-0.01, -0.02, 0.0], abs=1e-5)
    assert (rig.parent / "rig.toml.bak").read_text(encoding="utf-8") == RIG, "the file from before the first change"
    nudged = {"op": "place_object", "body": "Box", "position": [0, 0.01, 0], "rotation": [0, 0, 0, 2], "store": False}
    assert stage.server.ask(nudged)["stored"] is None
    box = stage.server.ask({"op": "objects"})["bodies"]["actor"]["Box"]
    assert (box["position"], box["rotation"]) == ([0, 0.01, 0], [0, 0, 0, 1])
    assert tomllib.loads(rig.read_text(encoding="utf-8")) == stored


def test_a_pose_that_cannot_be_used_is_refused_and_nothing_changes(stage: Stage, rig: Path) -> None:
    crossed = dict(zip(SIDES, reversed(shown().values()), strict=True))
    refused = {
        "left_wrist is not tracked at present": stage.server.ask({"op": "calibrate"}),
        "it is at the right hand's mark": ask_while(stage, crossed, op="calibrate", sheet=SHEET_SAID),
        "m from the left wrist's mark; at most 0.20 m are allowed": ask_while(stage, shown(), op="calibrate"),
    }

    def walking(t_s: float):
        if t_s == 2.25:
            refused["while it had to be still"] = stage.server.ask({"op": "calibrate", "sheet": SHEET_SAID})
        away = np.array([0.02 * t_s, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        return clusters_of({side: wrist + away for side, wrist in shown().items()}, t_s)

    stage.perform(2.5, walking)

    def soon(t_s: float):
        if t_s == 1.0:
            refused["240 m tracked samples"] = stage.server.ask({"op": "calibrate", "sheet": SHEET_SAID})
        return clusters_of(shown(), t_s)

    stage.perform(1.25, soon)
    assert "tracked samples in that time, and at least 16" in refused.pop("240 m tracked samples")["error"]
    for complaint, answer in refused.items():
        assert complaint in answer["error"], answer
    assert rig.read_text(encoding="utf-8") == RIG


BAD = [
    ({"step": "toes"}, "step is 'toes'; allowed are wrists, fingertips"),
    ({"hand": "third"}, "hand is 'third'; allowed are both, left, right"),
    ({"hand_length": 2}, "hand_length is 2; allowed are 0.12 … 0.28"),
    ({"seconds": 9}, "seconds is 9; allowed are 0.5 … 4.0"),
    ({"reference": "Ball"}, "reference is 'Ball'; allowed are Box"),
    ({"sheet": [1, 2]}, "left_wrist is not tracked"),
    ({"actor": "ann"}, "actor is 'ann'; allowed are actor"),
    ({"op": "place_object", "body": "Ball"}, "body 'Ball' does not carry an object; allowed are Box"),
    ({"op": "place_object", "body": "left_wrist"}, "does not carry an object; allowed are Box"),
    ({"op": "place_object", "body": "Box", "position": [0, 1]}, "position is [0, 1]; it must be 3 numbers"),
    ({"op": "place_object", "body": "Box", "position": [0, "x", 1]}, "position is 'x'; it must be a number"),
    ({"op": "place_object", "body": "Box", "rotation": [0, 0, 0, 0]}, "rotation is zero"),
    ({"op": "place_object", "body": "Box", "store": "no"}, "store is 'no'; allowed are true and false"),
]


def test_the_answer_to_a_wrong_request_tells_what_is_allowed(stage: Stage, rig: Path) -> None:
    for request, complaint in BAD:
        assert complaint in stage.server.ask({"op": "calibrate"} | request)["error"]
    assert rig.read_text(encoding="utf-8") == RIG


def test_a_calibration_is_in_force_even_if_the_rig_file_cannot_be_written(stage: Stage, rig: Path) -> None:
    rig.write_text("[bodies\n", encoding="utf-8")
    answer = ask_while(stage, shown(), op="calibrate", sheet=SHEET_SAID)
    assert answer["stored"] is None
    assert "could not be changed" in answer["note"]
    assert "left_wrist = {body = " in answer["note"]
    assert rig.read_text(encoding="utf-8") == "[bodies\n"
    placed = stage.server.ask({"op": "objects"})["bodies"]["actor"]["Box"]
    assert placed["object"] == "cube"
