"""Hands solved on avatars, by a real server: upload, topics, limits of number, a rig's own profile."""

import json
import socket
import time
from contextlib import ExitStack

import msgpack
import numpy as np
import pytest
import zmq
from avatar_profiles import as_content, scaled_profile
from live_server import serving
from pythonosc.osc_bundle import OscBundle
from websockets.sync.client import connect
from websockets.typing import Origin

from manipnet.actors.avatar import Avatar
from manipnet.page.playback import read_recording
from manipnet.recording.mcap_file import read_about, read_hands, recorded_avatars
from manipnet.runtime.avatars import FORGET_AFTER_S, MAX_PROFILES, Avatars, TooManyProfilesError
from manipnet.synthesis.hand.profile import parse_profile, profile_to_json
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.telemetry import Telemetry
from manipnet.wire import decode_binary, decode_msgpack
from manipnet_tools.export.animation import read_animation
from manipnet_tools.takes.take import read_take

MODEL = shipped_hand()
LONG, SMALL = scaled_profile(MODEL, 1.15, name="long"), scaled_profile(MODEL, whole=0.85, name="small")


@pytest.fixture(scope="module")
def takes(tmp_path_factory):
    return tmp_path_factory.mktemp("takes")


@pytest.fixture(scope="module")
def receivers():
    """The programs that the server sends hands to, by its options."""
    with ExitStack() as opened:
        sockets = {}
        for option in ("--vmc", "--livelink"):
            sockets[option] = opened.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            sockets[option].bind(("127.0.0.1", 0))
            sockets[option].settimeout(20.0)
        yield sockets


@pytest.fixture(scope="module")
def server(tmp_path_factory, receivers, takes):
    file = tmp_path_factory.mktemp("hand") / "small.json"
    file.write_text(profile_to_json(SMALL), encoding="utf-8")
    to = [f"{option}=127.0.0.1:{receiver.getsockname()[1]}" for option, receiver in receivers.items()]
    with serving("--demo", "--hand", str(file), "--takes", str(takes), *to) as server:
        yield server


def received(server, *topics: str, seconds: float = 3.0) -> dict[str, list[bytes]]:
    with zmq.Context() as context, context.socket(zmq.SUB) as sub:
        sub.setsockopt(zmq.LINGER, 0)
        sub.connect(server.addresses["hands"])
        for topic in topics:
            sub.subscribe(f"{topic} ")
        found: dict[str, list[bytes]] = {topic: [] for topic in topics}
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            if sub.poll(100):
                topic, _, payload = sub.recv().partition(b" ")
                found[topic.decode()].append(payload)
        return found


@pytest.mark.parametrize("nested", [False, True])
def test_an_uploaded_hand_is_published_beside_the_models(server, nested):
    content = as_content(LONG)
    request = {"op": "hand_profile", "profile": content} if nested else {"op": "hand_profile", **content}
    answer = server.ask(request, as_json=True)
    assert answer["topics"] == ["hand/long/msgpack", "hand/long/bin"]
    found = received(server, "hand/long/msgpack", "hand/long/bin", "pose/msgpack")
    assert min(map(len, found.values())) > 60
    last = msgpack.unpackb(found["hand/long/msgpack"][-1])
    assert last["hand"] == "long"
    assert "hand" not in msgpack.unpackb(found["pose/msgpack"][-1])
    models = {m["seq"]: m for m in map(msgpack.unpackb, found["pose/msgpack"])}
    binary = {m.seq: m for m in map(decode_binary, found["hand/long/bin"])}
    message = decode_msgpack(found["hand/long/msgpack"][-2])
    np.testing.assert_allclose(binary[message.seq].hands["left"].joints, message.hands["left"].joints, atol=1e-6)
    for side, hand in message.hands.items():
        model = models[message.seq]["hands"][side]
        assert hand.scale == 1.0
        assert hand.wrist_shift is not None
        assert np.linalg.norm(hand.wrist_shift) <= 0.03 + 1e-6
        np.testing.assert_allclose(hand.wrist[:3] - hand.wrist_shift, model["wrist"]["p"], atol=1e-6)
        np.testing.assert_allclose(hand.joints[1, :3], hand.wrist[:3], atol=1e-6)
        rest = LONG.hands[side].joints
        for a, b in ((7, 8), (8, 9), (9, 10), (3, 4), (1, 7)):
            assert np.linalg.norm(hand.joints[b, :3] - hand.joints[a, :3]) == pytest.approx(
                np.linalg.norm(rest[b, :3] - rest[a, :3]), abs=1e-5
            )


def test_the_hand_of_the_command_line_is_there_from_the_start(server):
    found = received(server, "hand/small/bin", seconds=2.0)
    assert len(found["hand/small/bin"]) > 30


def test_programs_that_show_avatars_get_the_hand_of_the_command_line(server, receivers):
    subjects = {next(iter(json.loads(receivers["--livelink"].recv(65536)))) for _ in range(60)}
    assert {"ManipNet_actor_small_left", "ManipNet_actor_right"} <= subjects
    bundle = OscBundle(receivers["--vmc"].recv(4096))
    bones = {m.params[0]: m.params[1:] for m in bundle if m.address == "/VMC/Ext/Bone/Pos"}
    side = "left" if "LeftHand" in bones else "right"
    rest = SMALL.hands[side].joints
    for name, a, b in (("IndexProximal", 1, 7), ("IndexDistal", 8, 9), ("ThumbIntermediate", 2, 3)):
        length = np.linalg.norm(bones[f"{side.capitalize()}{name}"][:3])
        assert length == pytest.approx(np.linalg.norm(rest[b, :3] - rest[a, :3]), abs=1e-5)
    assert server.ask({"op": "status"})["counters"]["messages_out"]["vmc"] > 0


@pytest.mark.parametrize(
    ("request_", "reason"),
    [
        ({}, "name must be a text"),
        ({"name": "x"}, "neither a left nor a right hand"),
        ({"name": "x", "left": {"joints": 3}}, "left: joints must be a list of 26"),
        ({"name": "x", "left": as_content(LONG)["right"]}, "this is a right hand"),
        ({**as_content(LONG), "actor": "nobody"}, "actor is 'nobody'"),
        ({"profile": 3}, "is a map"),
    ],
)
def test_a_wrong_profile_is_refused_and_the_server_goes_on(server, request_, reason):
    assert reason in server.ask({"op": "hand_profile", **request_})["error"]
    assert server.ask({"op": "ping"})["t"] > 0


def test_a_recording_keeps_the_hands_of_avatars_and_their_profiles(server, takes):
    server.ask({"op": "record", "name": "take"})
    server.ask({"op": "hand_profile", **as_content(scaled_profile(MODEL, 1.05, name="late"))})
    assert len(received(server, "hand/late/bin", seconds=1.5)["hand/late/bin"]) > 20
    ended = server.ask({"op": "stop_recording"})
    path = takes / "take.mcap"
    about = read_about(path)
    assert set(recorded_avatars(about)) == {"small", "late"}  # nobody has subscribed to small
    small, model = list(read_hands(path, "small")), list(read_hands(path))
    assert abs(len(small) - len(model)) <= 1
    assert ended["avatars"] == len(small) + len(list(read_hands(path, "late")))
    for name, expected in (("small", SMALL), ("late", scaled_profile(MODEL, 1.05, name="late"))):
        profile = parse_profile(json.loads(about.metadata[f"hand {name}"]))
        np.testing.assert_allclose(profile.hands["left"].joints, expected.hands["left"].joints, atol=1e-6)
    assert len(read_animation(path, MODEL).time_s) == len(model)
    assert read_recording(path).messages[0].hand is None
    assert read_take(path).bodies


class Audience:
    def __init__(self):
        self.wanted: set[str] = set()

    def wants(self, avatar):
        return avatar in self.wanted

    def publish_avatar(self, message, profile):
        raise AssertionError


def test_a_profile_is_forgotten_when_nobody_subscribes():
    now = [0.0]
    avatars, audience = Avatars(Telemetry(), lambda: now[0]), Audience()
    avatars.audience = audience
    avatars.add(Avatar(LONG, MODEL), "actor")
    avatars.add(Avatar(SMALL, MODEL), "actor", stays=True)
    audience.wanted = {"long"}
    now[0] = 10 * FORGET_AFTER_S
    avatars.forget_unwanted()
    assert set(avatars.names()) == {("long", "actor"), ("small", "actor")}
    audience.wanted.clear()
    now[0] += FORGET_AFTER_S - 1.0
    avatars.forget_unwanted()
    assert ("long", "actor") in avatars.names()
    now[0] += 2.0
    avatars.forget_unwanted()
    assert set(avatars.names()) == {("small", "actor")}


def test_there_is_room_for_sixteen_profiles():
    avatars = Avatars(Telemetry())
    for n in range(MAX_PROFILES):
        avatars.add(Avatar(scaled_profile(MODEL, name=f"hand{n}"), MODEL), "actor")
    avatars.add(Avatar(scaled_profile(MODEL, 1.1, name="hand3"), MODEL), "actor")
    with pytest.raises(TooManyProfilesError, match=r"already has 16 .* no more are allowed .*hand15"):
        avatars.add(Avatar(LONG, MODEL), "actor")


def test_one_profile_may_be_that_of_several_actors():
    avatars = Avatars(Telemetry())
    first, second = Avatar(LONG, MODEL), Avatar(LONG, MODEL)
    avatars.add(first, "one", stays=True)
    avatars.add(second, "two", stays=True)
    avatars.add(Avatar(scaled_profile(MODEL, 0.9, name="long"), MODEL), "two")
    assert avatars.names() == [("long", "one"), ("long", "two")]
    assert avatars.profiles()[0] is LONG


def test_a_wrong_hand_file_stops_the_start(tmp_path):
    from live_server import LiveServer

    file = tmp_path / "hand.json"
    file.write_text(json.dumps({"name": "x"}), encoding="utf-8")
    server = LiveServer("--demo", "--hand", str(file))
    assert server.process.wait(120) == 1
    assert "has neither a left nor a right hand" in "".join(server.errors)


def uploaded(connection, request):
    return answered(connection, json.dumps(request))


def answered(connection, message):
    """The answer to a message over WebSocket, whose text comes among binary payloads."""
    connection.send(message)
    while isinstance(answer := connection.recv(timeout=20), bytes):
        pass
    return json.loads(answer)


def test_a_browser_uploads_its_hand_and_receives_it_over_one_websocket(server):
    profile = scaled_profile(MODEL, 1.1, name="bröwser")
    with connect(f"{server.addresses['web']}/hand/br%C3%B6wser", origin=Origin("http://localhost:8000")) as connection:
        answer = uploaded(connection, {"op": "hand_profile", **as_content(profile)})
        assert (answer["name"], answer["topics"][1]) == ("bröwser", "hand/bröwser/bin")
        hand = decode_binary(connection.recv(timeout=20, decode=False)).hands["left"]
        rest = profile.hands["left"].joints
        for a, b in ((7, 8), (8, 9), (3, 4)):
            assert np.linalg.norm(hand.joints[b, :3] - hand.joints[a, :3]) == pytest.approx(
                np.linalg.norm(rest[b, :3] - rest[a, :3]), abs=1e-5
            )


def test_a_bad_upload_over_websocket_costs_only_itself(server):
    with connect(f"{server.addresses['web']}/hand/small") as connection:
        assert "allowed is hand_profile" in uploaded(connection, {"op": "rest"})["error"]
        assert "neither a left nor a right" in uploaded(connection, {"op": "hand_profile", "name": "x"})["error"]
        assert "neither a msgpack nor a JSON map" in answered(connection, '{"a":' * 10_000)["error"]
        assert "must be a text message" in answered(connection, b"\x81\xa2op\xachand_profile")["error"]
        for _ in range(60):
            assert connection.recv(timeout=20)
    assert server.ask({"op": "ping"})["t"] > 0


def test_the_python_client_uploads_and_receives(server):
    from manipnet_client import Client, ControlClient

    control = ControlClient(server.addresses["control"])
    name = control.upload_hand(as_content(scaled_profile(MODEL, 0.9, name="python")))
    with Client(server.addresses["hands"], hand=name) as client:
        hands = client.wait(timeout_s=20.0)
        assert hands is not None
        assert hands.left is not None
