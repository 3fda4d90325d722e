"""The requests of an operator: pause, and a mesh to add."""

from pathlib import Path

import numpy as np
import pytest
from live_server import Stage, own_address, scene, serving

from manipnet.synthesis.objects.library import LIBRARY_FOLDER


def test_paused_hands_stay_where_they_are_until_the_pause_ends(stage: Stage) -> None:
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


def test_a_mesh_is_added_and_selected(stage: Stage, tmp_path: Path) -> None:
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
def test_a_file_that_is_not_a_mesh_is_refused_with_the_reason(stage: Stage, more: dict, complaint: str) -> None:
    assert complaint in stage.server.ask({"op": "add_object"} | more)["error"]


def test_a_client_on_another_machine_may_not_let_the_server_open_files(tiny_bundle: Path, tmp_path: Path) -> None:
    if (address := own_address()) is None:
        pytest.skip("this machine has no address but its loopback")
    path = tmp_path / "club.ply"
    path.write_bytes((LIBRARY_FOLDER / "hammer.ply").read_bytes())
    with serving("--model", str(tiny_bundle), "--host", "0.0.0.0", "--insecure") as server:
        request = {"op": "add_object", "file": str(path)}
        port = server.addresses["control"].rpartition(":")[2]
        server.addresses["control"] = f"tcp://{address}:{port}"
        refusals = [server.ask(request | {"file": file})["error"] for file in (str(path), "/nowhere.obj")]
        assert refusals[0] == refusals[1], "the answer does not tell which files exist"
        assert "only a client on that machine may ask; put the mesh into" in refusals[0]
        assert "club" not in server.ask({"op": "objects"})["objects"]
        server.addresses["control"] = f"tcp://127.0.0.1:{port}"
        assert server.ask(request) == {"object": "club"}
