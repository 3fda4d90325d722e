"""Clients that ask for ever more: the server stays bounded, publishes, and answers the others at once."""

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh
from live_server import LiveServer, Sender, Subscriber, scene, serving

STILL = (0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
MANY = 400


@pytest.fixture
def server(tiny_bundle: Path, tmp_path: Path) -> Iterator[LiveServer]:
    with serving("--mesh", "Box=cube", "--model", str(tiny_bundle), "--takes", str(tmp_path / "takes")) as server:
        yield server


def tetrahedron(path: Path, edge_m: float) -> Path:
    vertices = edge_m * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    trimesh.Trimesh(vertices, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]).export(path)
    return path


def test_ever_more_bodies_never_stop_the_output(server: LiveServer) -> None:
    for i in range(MANY):
        server.ask({"op": "select_object", "body": f"more{i}", "object": "cube"})
    subscriber, senders = Subscriber(server.addresses["hands"]), [Sender(server.addresses["bodies"]) for _ in range(2)]
    try:
        begin_s = time.monotonic()
        for k in range(240):
            time.sleep(max(begin_s + k / 120.0 - time.monotonic(), 0.0))
            halves = [range(i, MANY, 2) for i in range(2)]
            for sender, half, more in zip(senders, halves, (scene(k / 120.0), {}), strict=True):
                sender.send(100.0 + k / 120.0, more | {f"more{i}": STILL for i in list(half)[:250]})
        messages = subscriber.until(101.0)
    finally:
        subscriber.close()
        for sender in senders:
            sender.close()
    assert messages[-1].hands["left"].state == "live"
    assert "publish" not in server.ask({"op": "status"})["counters"].get("tick_errors", {})


def test_the_number_of_props_is_bounded_and_the_rig_keeps_its_own(server: LiveServer) -> None:
    for i in range(MANY):
        server.ask({"op": "select_object", "body": f"more{i}", "object": "cube"})
    carried = server.ask({"op": "objects"})["bodies"]["actor"]
    assert len(carried) <= 32
    assert "Box" in carried
    assert f"more{MANY - 1}" in carried


def test_objects_nobody_carries_are_given_back(server: LiveServer, tmp_path: Path) -> None:
    for i in range(60):
        answer = server.ask({"op": "add_object", "file": str(tetrahedron(tmp_path / f"t{i}.ply", 0.05 + 1e-3 * i))})
        assert answer.get("object") == f"t{i}"
    first = resident_mb(server)
    for i in range(60, 160):
        server.ask({"op": "add_object", "file": str(tetrahedron(tmp_path / f"t{i}.ply", 0.05 + 1e-3 * i))})
    assert resident_mb(server) - first < 150.0


def test_a_long_mesh_build_lets_others_be_answered(server: LiveServer, tmp_path: Path) -> None:
    mesh = trimesh.creation.icosphere(subdivisions=7, radius=0.05)  # 327,680 triangles
    mesh.export(tmp_path / "large.ply")
    done = threading.Event()

    def add() -> None:
        server.ask({"op": "add_object", "file": str(tmp_path / "large.ply")})
        done.set()

    thread = threading.Thread(target=add)
    thread.start()
    paused = 0
    while not done.is_set() and paused < 20:
        assert server.ask({"op": "pause"})["paused"] is True
        assert server.ask({"op": "select_object", "body": "Box", "object": "cube"})["object"] == "cube"
        paused += 1
    assert not done.is_set(), "a request had to wait for the mesh"
    thread.join()


def test_a_recording_that_begins_lets_others_be_answered(server: LiveServer, tmp_path: Path) -> None:
    # The new process reads the mesh, which is larger than a pipe, only once it has loaded its libraries.
    trimesh.creation.icosphere(subdivisions=5, radius=0.05).export(tmp_path / "large.ply")
    server.ask({"op": "add_object", "file": str(tmp_path / "large.ply")})
    assert "error" not in server.ask({"op": "select_object", "body": "Box", "object": "large"})
    order: list[str] = []

    def record() -> None:
        server.ask({"op": "record"})
        order.append("record")

    thread = threading.Thread(target=record)
    thread.start()
    for _ in range(3):
        server.ask({"op": "pause", "on": False})
    order.append("pause")
    thread.join()
    server.ask({"op": "stop_recording"})
    assert order == ["pause", "record"]


@pytest.mark.parametrize(
    "request_",
    [
        {"op": "look_ahead", "seconds": 10**400},
        {"op": "select_object", "body": "Box", "object": "cube", "scale": 10**400},
        {"op": "add_object", "file": "a\0b.ply"},
        {"op": "select_object", "body": "a\x1b[31m\n", "object": "cube"},
        {"op": "add_object", "file": "/tmp/\ud800.ply"},
        *({"op": "record", "name": name} for name in ("COM1", "com¹", "LPT9.mcap", "nul", "Aux .x", "con.take")),
    ],
)
def test_what_makes_no_sense_is_refused_by_its_reason(server: LiveServer, request_: dict) -> None:
    error = server.ask(request_, as_json=True).get("error", "")
    assert error
    assert "inside the server" not in error


def resident_mb(server: LiveServer) -> float:
    for line in Path(f"/proc/{server.process.pid}/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) / 1024.0
    raise AssertionError("no resident size")
