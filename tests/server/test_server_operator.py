"""What an operator asks for beside the rig: pause, and a mesh more to choose from."""

from pathlib import Path

import numpy as np
import pytest
from live_server import Stage, own_address, scene, serving

from manipnet.synthesis.objects.library import LIBRARY_FOLDER


def test_paused_hands_stay_where_they_are_and_then_go_on(stage: Stage) -> None:
    def poses(t_s: float):
        if t_s in (1.0, 2.5):
            assert stage.server.ask({"op": "pause", "on": t_s == 1.0})["paused"] == (t_s == 1.0)
        return scene(t_s)

    messages = stage.perform(4.0, poses)
    held = [m for m in messages if m.hands["right"].state == "hold"]
    assert len(held) > 30
    assert np.ptp([m.hands["right"].wrist for m in held], axis=0).max() == 0.0
    assert np.ptp([m.hands["right"].angles for m in held], axis=0).max() == 0.0
    assert messages[-1].hands["right"].state == "live"
    assert "on is 3; allowed are true and false" in stage.server.ask({"op": "pause", "on": 3})["error"]


def test_a_mesh_is_brought_in_and_selected(stage: Stage, tmp_path: Path) -> None:
    path = tmp_path / "club.ply"
    path.write_bytes((LIBRARY_FOLDER / "hammer.ply").read_bytes())
    assert stage.server.ask({"op": "add_object", "file": str(path)}) == {"object": "club"}
    assert "club" in stage.server.ask({"op": "objects"})["objects"]
    assert stage.server.ask({"op": "select_object", "body": "Box", "object": "club"})["object"] == "club"
    stage.server.ask({"op": "select_object", "body": "Box", "object": "cube"})


@pytest.mark.parametrize(
    ("more", "complaint"),
    [
        ({}, "file is missing or is not a path"),
        ({"file": "nowhere.obj"}, "nowhere.obj: no such file"),
        ({"file": str(LIBRARY_FOLDER / "cube.ply"), "unit": "furlong"}, "unit is 'furlong'; allowed are m, dm"),
        ({"file": str(LIBRARY_FOLDER / "cube.ply"), "unit": "mm"}, "cube.ply: "),
    ],
)
def test_what_is_no_mesh_is_said(stage: Stage, more: dict, complaint: str) -> None:
    assert complaint in stage.server.ask({"op": "add_object"} | more)["error"]


def test_another_machine_may_not_have_files_opened_here(tiny_bundle: Path, tmp_path: Path) -> None:
    if (address := own_address()) is None:
        pytest.skip("this machine has no address but its loopback")
    path = tmp_path / "club.ply"
    path.write_bytes((LIBRARY_FOLDER / "hammer.ply").read_bytes())
    with serving("--model", str(tiny_bundle), "--host", "0.0.0.0", "--insecure") as server:
        asked = {"op": "add_object", "file": str(path)}
        port = server.addresses["control"].rpartition(":")[2]
        server.addresses["control"] = f"tcp://{address}:{port}"
        said = [server.ask(asked | {"file": file})["error"] for file in (str(path), "/nowhere.obj")]
        assert said[0] == said[1], "it does not tell what is there"
        assert "only a client on that machine may ask; put the mesh into" in said[0]
        assert "club" not in server.ask({"op": "objects"})["objects"]
        server.addresses["control"] = f"tcp://127.0.0.1:{port}"
        assert server.ask(asked) == {"object": "club"}
