"""Requests to a real server: every operation, and everything that is not one."""

import base64
import json
import time

import msgpack
import numpy as np
import pytest
import zmq
from live_server import Stage, scene

from manipnet.net.clock_offset import measure_offset
from manipnet.synthesis.objects.library import library_names, load_library_mesh
from manipnet.telemetry import CONTROL_OPS
from manipnet.wire.hand_names import ANGLE_NAMES, JOINT_NAMES, OPENXR_JOINT_NAMES

OPS = ", ".join(op for op in CONTROL_OPS if op != "invalid")


@pytest.mark.parametrize("as_json", [True, False])
def test_hello_says_what_a_client_must_know(stage: Stage, as_json: bool) -> None:
    hello = stage.server.ask({"op": "hello"}, as_json)
    assert hello["schema"] == 1
    assert hello["joint_names"] == list(JOINT_NAMES)
    assert hello["angle_names"] == list(ANGLE_NAMES)
    assert hello["openxr_joint_names"] == list(OPENXR_JOINT_NAMES)
    assert hello["actors"] == ["actor"]
    assert set(library_names()) <= set(hello["objects"])
    assert hello["session"] == stage.perform(0.1, scene)[0].session


def test_ping_tells_the_clock_that_stamps_the_messages(stage: Stage) -> None:
    before = stage.server.ask({"op": "ping"})["t"]
    published = stage.perform(0.1, scene)[-1].t_publish
    assert before < published < stage.server.ask({"op": "ping"})["t"]


def test_the_clock_is_measured_by_ping_and_published_with_its_uncertainty(stage: Stage) -> None:
    ahead_s = 1_000.0
    with zmq.Context() as context, context.socket(zmq.REQ) as req:
        req.connect(stage.server.addresses["control"])

        def ping(**report: float | str) -> float:
            req.send(msgpack.packb({"op": "ping", **report}))
            return msgpack.unpackb(req.recv())["t"]

        server = measure_offset(ping, lambda: time.monotonic() + ahead_s)
        assert abs(server.offset_s + ahead_s) <= server.uncertainty_s
        ping(name="tracker-pc", offset=-server.offset_s, uncertainty=server.uncertainty_s)
    clock = stage.server.ask({"op": "status"})["clocks"]["tracker-pc"]
    assert clock["clock_offset_s"] == -server.offset_s
    assert clock["clock_uncertainty_s"] == server.uncertainty_s
    assert 0.0 <= clock["age_s"] < 20.0
    refused = stage.server.ask({"op": "ping", "name": "tracker-pc", "offset": "much"})
    assert refused == {"error": "offset is 'much'; it must be a number in -10000000000.0 … 10000000000.0"}


def test_status_tells_who_sends_and_who_is_connected(stage: Stage) -> None:
    stage.perform(1.2, scene)
    status = stage.server.ask({"op": "status"}, as_json=True)
    (sender,) = (sender for source, sender in status["senders"].items() if sender["age_s"] < 1.0)
    assert sender["frames"] > 120
    assert 0.0 < sender["rate_hz"] < 180.0, "by arrival, which a busy machine slows"
    newest_s = stage.start_s + 1.2  # sent just before the answer's time
    assert newest_s - status["t"] <= sender["clock_offset_s"] < newest_s
    assert sender["clock_uncertainty_s"] is None
    assert status["connections"] == {"hands": 1, "web": 0, "bodies": 1, "control": 1}


def test_status_tells_the_health_of_every_body_and_hand(stage: Stage) -> None:
    stage.perform(1.0, scene)
    status = stage.server.ask({"op": "status"}, as_json=True)
    actor = status["actors"]["actor"]
    assert set(actor["bodies"]) == {"left_wrist", "right_wrist", "Box"}
    assert actor["bodies"]["Box"]["rate_hz"] == pytest.approx(120.0, rel=0.01)
    assert 0.0 <= actor["bodies"]["Box"]["noise_m"] < 1e-5
    assert 0.0 <= actor["bodies"]["Box"]["noise_rad"] < 1e-4
    assert actor["hands"]["left"]["state"] in ("live", "hold", "rest")
    assert status["counters"]["frames_in"]["zmq"] > 100
    assert 0.0 < status["delay_ms"]["p50"] <= status["delay_ms"]["max"]


def test_a_client_receives_the_mesh_that_a_body_carries(stage: Stage) -> None:
    stage.server.ask({"op": "select_object", "body": "Box", "object": "cube", "scale": 0.5})
    answer = stage.server.ask({"op": "mesh", "body": "Box"}, as_json=True)
    assert (answer["object"], answer["scale"]) == ("cube", 0.5)
    mesh = load_library_mesh("cube")
    vertices = np.frombuffer(base64.b64decode(answer["vertices"]), "<f4").reshape(-1, 3)
    faces = np.frombuffer(base64.b64decode(answer["faces"]), "<u4").reshape(-1, 3)
    assert np.allclose(vertices, mesh.vertices, atol=1e-6)
    assert np.array_equal(faces, mesh.faces)
    assert "allowed are Box" in stage.server.ask({"op": "mesh", "body": "Cup"})["error"]


def carried(stage: Stage) -> tuple[str, float]:
    box = stage.server.ask({"op": "objects"})["bodies"]["actor"]["Box"]
    return box["object"], box["scale"]


def test_an_object_is_swapped_while_the_hands_are_on_it(stage: Stage) -> None:
    for name in ("sphere", "cube"):  # both built once, which may take a while
        stage.server.ask({"op": "select_object", "body": "Box", "object": name})
    assert carried(stage) == ("cube", 1.0)
    swapped = {}

    def poses(t_s: float):
        if t_s == 0.5:
            swapped.update(stage.server.ask({"op": "select_object", "body": "Box", "object": "sphere", "scale": 0.8}))
        return scene(t_s)

    messages = stage.perform(1.0, poses)
    first_shown = swapped.pop("seq")
    assert swapped == {"actor": "actor", "body": "Box", "object": "sphere", "scale": 0.8}
    assert messages[0].seq - 1 <= first_shown < messages[-1].seq, "the tick that was being made may be the one before"
    assert len(messages) == 61
    assert {hand.object for m in messages for hand in m.hands.values()} == {"Box"}
    assert carried(stage) == ("sphere", 0.8)
    stage.server.ask({"op": "select_object", "body": "Box", "object": "cube"})


def test_a_body_that_the_rig_does_not_name_may_carry_an_object(stage: Stage) -> None:
    stage.server.ask({"op": "select_object", "body": 42, "object": "sphere"})
    poses = lambda t: {k: v for k, v in scene(t).items() if k != "Box"} | {42: scene(t)["Box"]}  # noqa: E731
    assert stage.perform(0.4, poses)[-1].hands["left"].object == "42"


def test_the_look_ahead_changes_while_it_runs(stage: Stage) -> None:
    assert stage.server.ask({"op": "look_ahead", "seconds": 0.1}) == {"seconds": 0.1}
    messages = stage.perform(2.5, scene)
    assert len(messages) == 151
    assert messages[-1].look_ahead == pytest.approx(0.1)
    stage.server.ask({"op": "look_ahead", "seconds": 0.5})
    assert stage.perform(2.5, scene)[-1].look_ahead == pytest.approx(0.5)


def test_rest_eases_both_hands_to_rest_and_lets_them_go_on(stage: Stage) -> None:
    def poses(t_s: float):
        if t_s == 1.0:
            assert stage.server.ask({"op": "rest"}) == {"actors": ["actor"]}
        return scene(t_s)

    states = [m.hands["right"].state for m in stage.perform(4.0, poses)]
    changes = [state for i, state in enumerate(states) if i == 0 or state != states[i - 1]]
    assert changes[-3:] == ["live", "rest", "live"]


BAD = [
    ({}, f"op is missing; allowed are {OPS}"),
    ({"op": "fly"}, f"op is 'fly'; allowed are {OPS}"),
    ({"op": ["hello"]}, f"op is ['hello']; allowed are {OPS}"),
    ({"op": "invalid"}, f"op is 'invalid'; allowed are {OPS}"),
    ({"op": "look_ahead"}, "seconds is missing; it must be a number in 0.0 … 0.5"),
    ({"op": "look_ahead", "seconds": 0.6}, "seconds is 0.6; allowed are 0.0 … 0.5"),
    ({"op": "look_ahead", "seconds": float("nan")}, "seconds is nan; it must be a number"),
    ({"op": "look_ahead", "seconds": True}, "seconds is True; it must be a number"),
    ({"op": "select_object", "object": "cube"}, "body is missing; give the streaming id or the name"),
    ({"op": "select_object", "body": "Box", "object": "cloud"}, "object is 'cloud'; allowed are "),
    ({"op": "select_object", "body": "Box", "object": "cube", "scale": 0}, "scale is 0; allowed are 0.2 … 5.0"),
    ({"op": "select_object", "body": "left_wrist", "object": "cube"}, "body 'left_wrist' is the left_wrist"),
    ({"op": "rest", "actor": "nobody"}, "actor is 'nobody'; allowed are actor"),
]


@pytest.mark.parametrize(("request_", "complaint"), BAD, ids=[str(i) for i in range(len(BAD))])
@pytest.mark.parametrize("as_json", [True, False])
def test_the_answer_to_a_wrong_request_tells_what_is_allowed(
    stage: Stage, request_: dict, complaint: str, as_json: bool
) -> None:
    answer = stage.server.ask(request_, as_json)
    assert set(answer) == {"error"}
    assert complaint in answer["error"]
    assert "t" in stage.server.ask({"op": "ping"})


@pytest.mark.parametrize(
    "garbage", [b"", b"\xc1", b"hello", b"\x93\x01\x02\x03", msgpack.packb("hello"), b"\x00" * 4096]
)
def test_garbage_is_answered_with_an_error(stage: Stage, garbage: bytes) -> None:
    assert "map" in stage.server.ask(garbage)["error"]
    assert "t" in stage.server.ask({"op": "ping"})


def test_garbage_that_looks_like_json_is_answered_in_json(stage: Stage) -> None:
    with zmq.Context() as context, context.socket(zmq.REQ) as req:
        req.connect(stage.server.addresses["control"])
        for garbage in (b'{"op": ', b"[1, 2]"):
            req.send(garbage)
            assert "map" in json.loads(req.recv())["error"]
        req.send_multipart([b'{"op": "ping"}', b"more"])
        assert "2 frames" in json.loads(req.recv())["error"]
