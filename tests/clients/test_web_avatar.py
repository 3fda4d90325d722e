"""The web client's hands of avatars: real three.js in node, rigs in GLB files, and a real server."""

import json
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from checkout import CLIENTS, ROOT
from live_server import Stage, scene
from npm import run_node
from rig_writer import write_glb

from manipnet.geometry import SIDES, Side, quat_exp, quat_rotate
from manipnet.synthesis.hand.model_profile import model_profile
from manipnet.synthesis.hand.profile import FINGERS, parse_profile
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet_tools.hands.importing import import_profile

PACKAGES = ("three@0.170.0", "ws@8.18.0", "@webxr-input-profiles/assets@1.0.20")
WORDS = ("Thumb", "Index", "Middle", "Ring", "Pinky")
RUN = """
const { execFileSync } = require("child_process");
const { dirname, join } = require("path");
const [script, client, ...words] = process.argv.slice(1);
const modules = join(process.cwd(), "node_modules");
const files = words.map((word) => word.replace("npm:", modules + "/"));
console.log(execFileSync("node", [script, client, modules, ...files], { timeout: 90000, maxBuffer: 1e8 }).toString());
"""


def in_node(*words: str, script: str = "avatar.mjs") -> Any:
    """What a script prints."""
    path = ROOT / "tests" / "clients" / "web" / script
    return run_node(RUN, str(path), str(CLIENTS / "web"), *words, packages=PACKAGES)


def rig(path: Path, fingers: float = 0.85, bend: float = 0.0) -> Path:
    """A GLB file with hands whose fingers are `fingers` times as long as the model's, and bent at each joint."""
    nodes = [("Hips", -1, np.zeros(3))]
    for side in SIDES:
        joints = model_profile(shipped_hand(), side).joints[:, :3]
        turn = quat_exp(np.array([0.4, -1.1, 0.7]))
        at = np.array([0.7 if side == "left" else -0.7, 1.4, 0.1])
        hand = len(nodes)
        nodes.append((f"mixamorig:{side.capitalize()}Hand", 0, at))
        for word, row in zip(WORDS, FINGERS, strict=True):
            chain, parent = row if word == "Thumb" else row[1:], hand
            place = joints[chain[0]]
            for number, joint in enumerate(chain):
                if number:
                    way = fingers * (joints[joint] - joints[chain[number - 1]])
                    place = place + quat_rotate(quat_exp(np.array([-bend * number, 0.0, 0.0])), way)
                nodes.append(
                    (f"mixamorig:{side.capitalize()}Hand{word}{number + 1}", parent, at + quat_rotate(turn, place))
                )
                parent = len(nodes) - 1
    return write_glb(path, nodes)


@pytest.mark.parametrize("bend", [0.0, 0.2])
def test_a_profile_is_that_of_the_import(tmp_path: Path, bend: float) -> None:
    file = rig(tmp_path / "avatar.glb", bend=bend)
    ours = parse_profile(in_node("profile", str(file), "{}"))
    assert ours.name.startswith("avatar-")
    compare(ours, import_profile(file, "avatar", shipped_hand(), lambda _: None))


@pytest.mark.parametrize("side", SIDES)
def test_a_profile_of_a_skinned_hand_is_that_of_the_import(side: Side, tmp_path: Path) -> None:
    where = f"@webxr-input-profiles/assets/dist/profiles/generic-hand/{side}.glb"
    ours = parse_profile(in_node("profile", f"npm:{where}", json.dumps({"side": side})))
    assert not np.isnan(ours.hands[side].radii[7])
    copy = tmp_path / f"{side}.glb"
    copy.write_bytes(Path(in_node("path", f"npm:{where}", json.dumps({"side": side}))["path"]).read_bytes())
    compare(ours, import_profile(copy, "hand", shipped_hand(), lambda _: None))


def compare(ours, theirs) -> None:
    for side in SIDES:
        a, b = ours.hands[side], theirs.hands[side]
        np.testing.assert_allclose(a.joints[:, :3], b.joints[:, :3], atol=5e-4)
        assert np.nanmin(np.abs(np.sum(a.joints[:, 3:] * b.joints[:, 3:], axis=1))) > 0.9999
        np.testing.assert_allclose(a.radii, b.radii, atol=5e-5)


def test_arms_reach_the_wrist_and_keep_their_lengths() -> None:
    for shown in in_node(script="arm.mjs"):
        assert max(shown["tip"], shown["hand"]) < 1e-5
        np.testing.assert_allclose(shown["arm"], np.hypot(0.25, np.hypot(0.02, 0.02)), atol=1e-6)


@pytest.fixture(scope="module")
def performing(stage: Stage) -> Iterator[str]:
    """The web address of a real server that carries a box between two hands all the time."""
    stop = threading.Event()

    def send() -> None:
        begin_s = time.monotonic()
        while not stop.wait(1.0 / 120.0):
            t_s = time.monotonic() - begin_s
            stage.sender.send(t_s, scene(t_s))

    sending = threading.Thread(target=send)
    sending.start()
    yield stage.server.addresses["web"]
    stop.set()
    sending.join()


def test_fingertips_lie_where_the_server_says(performing: str, tmp_path: Path) -> None:
    file = rig(tmp_path / "avatar.glb", bend=0.2)
    tips = [
        [f"mixamorig{side.capitalize()}Hand{word}4", side, row[-1]]
        for side in SIDES
        for word, row in zip(WORDS, FINGERS, strict=True)
    ]
    result = in_node("tips", str(file), "{}", performing, json.dumps(tips))
    assert max(result["arrived"]) < 1e-3, result
    assert max(result["shown"]) < 1e-3, result


def test_a_refusal_has_the_reason_of_the_server(performing: str, tmp_path: Path) -> None:
    file = rig(tmp_path / "avatar.glb", fingers=12.0)
    assert "m long" in in_node("tips", str(file), "{}", performing, "[]")["problem"]
