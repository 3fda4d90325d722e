"""A server that anybody may reach says so, and lets nobody else change files of its machine."""

from pathlib import Path

import pytest
from live_server import LiveServer, own_address, serving

ROOT = Path(__file__).parents[2]


def test_an_insecure_server_says_so_and_lets_others_change_no_file(tiny_bundle: Path, tmp_path: Path) -> None:
    address = own_address()
    if address is None:
        pytest.skip("this machine has no address but its loopback")
    rig = tmp_path / "stage.toml"
    rig.write_text('[bodies]\nleft_wrist = 1\n[[objects]]\nbody = "Box"\nmesh = "cube"\n')
    options = ("--host", "0.0.0.0", "--insecure", "--rig", str(rig), "--model", str(tiny_bundle))
    with serving(*options) as server:
        here, there = server.addresses["control"], LiveServer.__new__(LiveServer)
        there.addresses = {"control": here.replace("0.0.0.0", address)}
        server.addresses["control"] = here.replace("0.0.0.0", "127.0.0.1")
        assert server.ask({"op": "status"})["exposed"] is True
        place = {"op": "place_object", "body": "Box", "position": [0.1, 0.0, 0.0]}
        before = rig.read_text()
        # An address of this machine's own is not the loopback, so it stands for another machine.
        assert '"store": false' in there.ask(place)["error"]
        assert rig.read_text() == before
        assert there.ask({**place, "store": False})["stored"] is None
        assert server.ask(place)["stored"] == str(rig)
    assert any("--insecure: every machine that reaches 0.0.0.0" in line for line in server.errors)


def test_a_server_on_loopback_is_not_called_exposed(tiny_bundle: Path) -> None:
    with serving("--model", str(tiny_bundle), "--insecure") as server:
        assert server.ask({"op": "status"})["exposed"] is False
    assert not any("insecure" in line for line in server.errors)


def test_the_container_is_not_open_by_default() -> None:
    command = [
        line for line in (ROOT / "Dockerfile").read_text().splitlines() if line.startswith(("CMD", "ENTRYPOINT"))
    ]
    assert command
    assert not any("--insecure" in line or "0.0.0.0" in line for line in command)
