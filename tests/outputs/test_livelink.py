"""Epic's JSON Live Link format: what its sample receiver parses, and poses that compose back to the world."""

import json
import socket

import numpy as np
from make_vectors import messages

from manipnet.geometry import compose
from manipnet.outputs.axes import to_unreal
from manipnet.outputs.declaration import EncodedHands
from manipnet.outputs.livelink import sender as livelink_json
from manipnet.wire.hand_names import OPENXR_JOINT_NAMES, OPENXR_PARENTS

LIVE = messages()["live"]


def test_bones_are_as_the_sample_receiver_expects():
    (subject, bones), *rest = json.loads(livelink_json.hand_json("a", "left", LIVE.hands["left"].joints)).items()
    assert subject == "ManipNet_a_left"
    assert not rest
    assert [bone["Name"] for bone in bones[:2]] == ["wrist", "palm"]
    assert {bone["Name"] for bone in bones} == set(OPENXR_JOINT_NAMES)
    for i, bone in enumerate(bones):
        assert -1 <= bone["Parent"] < i
        assert [len(bone[key]) for key in ("Location", "Rotation", "Scale")] == [3, 4, 3]
    by_name = {bone["Name"]: bone for bone in bones}
    for name, parent in zip(OPENXR_JOINT_NAMES, OPENXR_PARENTS, strict=True):
        index = by_name[name]["Parent"]
        assert (bones[index]["Name"] if index >= 0 else None) == (OPENXR_JOINT_NAMES[parent] if parent >= 0 else None)


def test_local_poses_compose_to_the_world():
    bones = json.loads(livelink_json.hand_json("a", "left", LIVE.hands["left"].joints))["ManipNet_a_left"]
    world = []
    for bone in bones:
        local = np.array(bone["Location"] + bone["Rotation"])
        world.append(local if bone["Parent"] < 0 else compose(world[bone["Parent"]], local))
    expected = to_unreal(LIVE.hands["left"].joints)[list(livelink_json.ORDER)]
    np.testing.assert_allclose([w[:3] for w in world], expected[:, :3], atol=1e-3)
    agreement = np.abs(np.sum(np.array(world)[:, 3:] * expected[:, 3:], axis=1))
    np.testing.assert_allclose(agreement, 1.0, atol=1e-5)


def test_one_datagram_per_hand_arrives():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(10)
        sender = livelink_json.LiveLinkJsonSender("127.0.0.1", receiver.getsockname()[1])
        sender.send(EncodedHands(LIVE))
        subjects = [next(iter(json.loads(receiver.recv(65536)))) for _ in range(2)]
        sender.close()
    assert subjects == ["ManipNet_actor_left", "ManipNet_actor_right"]
