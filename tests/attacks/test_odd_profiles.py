"""Hand profiles that no avatar has: each is refused with the reason, or served with finite hands."""

import copy
import json
import threading

import numpy as np
import pytest
import zmq
from avatar_profiles import as_content, scaled_profile
from live_server import LiveServer, Stage, scene, serving

from manipnet.geometry import SIDES, Side
from manipnet.outputs.vmc.avatar import AvatarSkeleton
from manipnet.synthesis.carrying import HandCarrier
from manipnet.synthesis.hand.avatar import avatar_hand
from manipnet.synthesis.hand.profile import FINGERS, ProfileError, parse_profile
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.synthesis.objects.library import load_library_mesh
from manipnet.synthesis.objects.shape import build_shape
from manipnet.wire import HandPose, HandsMessage, check, decode_msgpack

MODEL = shipped_hand()
WHOLE = as_content(scaled_profile(MODEL, name="odd"))
CUBE = build_shape(load_library_mesh("cube"))
WRIST = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0])


def changed(change) -> dict:
    """The profile of a right hand after `change(joints, hand)`."""
    content = copy.deepcopy(WHOLE)
    del content["left"]
    change(content["right"]["joints"], content["right"])
    return content


def put(joint: int, position):
    return lambda joints, hand: joints[joint].__setitem__(slice(3), position)


def gone(*numbers: int):
    def change(joints, hand):
        for k in numbers:
            joints[k] = None

    return change


def noisy(seed: int):
    rng = np.random.default_rng(seed)

    def change(joints, hand):
        size = 10 ** rng.uniform(-4, -1)
        for k in range(26):
            joints[k][:3] = (np.array(joints[k][:3]) + size * rng.normal(size=3)).tolist()
            if k != 1 and rng.random() < 0.2:
                quat = rng.normal(size=4)
                joints[k][3:] = (quat / np.linalg.norm(quat)).tolist()
        gone(*(k for k in range(26) if k != 1 and rng.random() < 0.3 and seed % 2))(joints, hand)

    return change


ODD = {
    **{f"joint {k} at the wrist": put(k, [0.0, 0.0, 0.0]) for k in range(2, 26)},
    **{f"joint {k} half a metre off": put(k, [0.2, 0.2, 0.4]) for k in range(2, 26, 3)},
    "flat": lambda joints, hand: [row.__setitem__(1, 0.0) for row in joints],
    "in a line": lambda joints, hand: [row.__setitem__(slice(2), [0.0, 0.0]) for row in joints],
    "one place": lambda joints, hand: [row.__setitem__(slice(3), [0.0, 0.0, -0.1]) for row in joints],
    "fingers at one place": lambda joints, hand: [put(k, joints[7][:3])(joints, hand) for k in range(2, 26)],
    "backward finger": lambda joints, hand: joints.__setitem__(slice(7, 11), joints[7:11][::-1]),
    "thick": lambda joints, hand: hand.__setitem__("radii", [0.08] * 26),
    "thin": lambda joints, hand: hand.__setitem__("radii", [0.0005] * 26),
    "one finger": gone(*range(2, 6), *range(11, 26)),
    "one bone": gone(*range(2, 6), *range(8, 10), *range(11, 26)),
    "no metacarpals": gone(0, 6, 11, 16, 21),
    "tips and roots": gone(*(k for row in FINGERS for k in row[2:-1])),
    **{f"noise {seed}": noisy(seed) for seed in range(40)},
}


@pytest.mark.parametrize("odd", ODD.values(), ids=ODD.keys())
def test_an_odd_hand_is_refused_or_its_messages_are_valid(odd):
    try:
        profile = parse_profile(changed(odd))
    except ProfileError:
        return
    rng = np.random.default_rng(0)
    hands: dict[Side, HandPose] = {}
    for side in SIDES:
        carrier = HandCarrier(avatar_hand(profile.hands[side], side, MODEL), MODEL, side)
        for k in range(4):
            held = (CUBE, np.array([0.0, 1.0, -0.06 if k < 3 else 0.0, 0.0, 0.0, 0.0, 1.0]), 1.0) if k else None
            pose = carrier.step(rng.uniform(*MODEL.limits.T), WRIST, held, 1.0)
            assert np.linalg.norm(pose.wrist[:3] - WRIST[:3]) < 0.0301
        hands[side] = HandPose("live", None, 1.0, np.zeros(20), pose.rotations, pose.wrist, pose.joints)
    check(HandsMessage("s", "actor", 0, 0.0, 0.0, 0.5, hands))
    for side in SIDES:
        poses = AvatarSkeleton(profile).bone_poses(side, hands[side])
        np.testing.assert_allclose(np.linalg.norm(poses[:, 3:], axis=1), 1.0, atol=1e-6)


REFUSED = {
    "NaN": (
        changed(put(8, [float("nan"), 0.0, 0.0])),
        "joint 8 (index_intermediate) holds a number",
    ),
    "far away": (changed(put(8, [1e9, 0.0, 0.0])), "m long"),
    "beyond all": (changed(put(8, [10**400, 0.0, 0.0])), "not finite"),
    "quaternion": (changed(lambda joints, _: joints[8].__setitem__(3, 2.0)), "quaternion of length"),
    "wrist": (changed(gone(1)), "the wrist (joint 1) is missing"),
    "count": (changed(lambda joints, _: joints.pop()), "a list of 26 poses"),
    "radii": (changed(lambda _, hand: hand.__setitem__("radii", [1.0] * 26)), "allowed are 0.0005 to 0.08 m"),
    "other side": ({"name": "odd", "right": WHOLE["left"]}, "this is a left hand"),
    "text": ({"name": "odd", "left": "hand"}, "left: must be a map"),
    **{
        f"name {name[:9]!r}": ({**WHOLE, "name": name}, "name")
        for name in ("", " ", "a b", "a/b", "a\nb", "a\0b", "\u202e", "x" * 64, "\U0001f590" * 16, "\ud800")
    },
}


@pytest.fixture(scope="module")
def stage(tiny_bundle):
    with serving("--mesh", "Box=cube", "--model", str(tiny_bundle)) as server:
        stage = Stage(server)
        yield stage
        stage.close()


@pytest.mark.parametrize(("content", "reason"), REFUSED.values(), ids=REFUSED.keys())
def test_a_wrong_profile_is_refused_with_the_reason(stage, content, reason):
    request = json.dumps({"op": "hand_profile", "profile": content}).encode()
    with zmq.Context() as context, context.socket(zmq.REQ) as control:
        control.setsockopt(zmq.LINGER, 0)
        control.connect(stage.server.addresses["control"])
        control.send(request)
        assert control.poll(20_000)
        assert reason in json.loads(control.recv())["error"]


@pytest.mark.parametrize("content", [b"{" + b'"a":[' * 30_000, b"\x91" * 60_000, b" " * 5_000_000])
def test_a_huge_or_nested_request_costs_only_itself(stage, content):
    with zmq.Context() as context, context.socket(zmq.REQ) as control:
        control.setsockopt(zmq.LINGER, 0)
        control.connect(stage.server.addresses["control"])
        control.send(content)
        if control.poll(1_000):  # a frame above the limit of the port closes the connection instead
            assert b"error" in control.recv()
    assert stage.server.ask({"op": "ping"})["t"] > 0


def test_a_name_may_be_of_any_script(stage):
    for name in ("Hände", "手", "\U0001f590", "x" * 63):
        assert stage.server.ask({"op": "hand_profile", **WHOLE, "name": name})["name"] == name


def test_messages_are_of_one_profile_while_clients_replace_it(stage):
    """Nothing is torn: every message has the bones of one of the profiles, whichever was uploaded last."""
    lengths = {size: as_content(scaled_profile(MODEL, size, name="shared")) for size in (0.8, 1.0, 1.2)}
    done = threading.Event()

    def upload(server: LiveServer, content: dict) -> None:
        while not done.is_set():
            assert server.ask({"op": "hand_profile", **content})["name"] == "shared"

    threads = [threading.Thread(target=upload, args=(stage.server, content)) for content in lengths.values()]
    with zmq.Context() as context, context.socket(zmq.SUB) as sub:
        sub.setsockopt(zmq.LINGER, 0)
        sub.subscribe(b"hand/shared/msgpack ")
        sub.connect(stage.server.addresses["hands"])
        for thread in threads:
            thread.start()
        stage.perform(2.0, scene)
        done.set()
        for thread in threads:
            thread.join()
        ratios = []
        while len(ratios) < 100:
            assert sub.poll(20_000)
            hand = decode_msgpack(sub.recv().partition(b" ")[2]).hands["right"]
            model = np.array([row[:3] for row in WHOLE["right"]["joints"]])
            bones = [
                np.linalg.norm(hand.joints[b, :3] - hand.joints[a, :3]) / np.linalg.norm(model[b] - model[a])
                for a, b in ((2, 3), (7, 8), (8, 9), (13, 14), (23, 24))
            ]
            assert max(bones) - min(bones) < 1e-4
            ratios.append(bones[0])
    assert len({round(ratio, 2) for ratio in ratios}) > 1


def test_the_seventeenth_profile_is_refused_with_what_is_allowed(stage):
    answers = [stage.server.ask({"op": "hand_profile", **WHOLE, "name": f"n{n}"}) for n in range(17)]
    assert "already has 16 hand profiles" in answers[-1]["error"]
    assert "60 s after its last subscriber has left" in answers[-1]["error"]
