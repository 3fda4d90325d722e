"""Epic's JSON Live Link format: what its sample receiver parses, and poses that compose back to the world."""

import contextlib
import json
import socket
from dataclasses import replace

import numpy as np
from make_vectors import messages

from manipnet.geometry import compose
from manipnet.outputs.axes import to_unreal
from manipnet.outputs.declaration import EncodedHands
from manipnet.outputs.livelink import sender as livelink_json
from manipnet.synthesis.hand.profile import HandProfile
from manipnet.wire import BodyPose
from manipnet.wire.hand_names import OPENXR_JOINT_NAMES, OPENXR_PARENTS

LIVE = messages()["live"]


def test_bones_are_as_the_sample_receiver_expects():
    (subject, bones), *rest = json.loads(livelink_json.hand_json("a_left", LIVE.hands["left"].joints)).items()
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
    bones = json.loads(livelink_json.hand_json("a_left", LIVE.hands["left"].joints))["ManipNet_a_left"]
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


class SampleReceiver:
    """What Epic's sample does with a datagram, by its source: names and parents are kept from the first frame on, and
    a subject with anything that it does not expect is left as it is."""

    def __init__(self):
        self.skeletons: dict[str, list[tuple[str, int]]] = {}
        self.frames: dict[str, list[list[float]]] = {}

    def take(self, datagram: bytes):
        text = "".join(map(chr, datagram))  # byte by byte, so that only ASCII arrives as it was sent
        for subject, bones in json.loads(text).items():
            assert isinstance(bones, list), "the sample reads every value as an array of bones"
            if subject not in self.skeletons:
                parents = [bone["Parent"] for bone in bones]
                assert all(type(parent) is int for parent in parents)
                self.skeletons[subject] = [(bone["Name"], bone["Parent"]) for bone in bones]
            frame = []
            for bone in bones:
                for key, count in (("Location", 3), ("Rotation", 4), ("Scale", 3)):
                    assert len(bone[key]) == count
                    assert all(isinstance(number, float) for number in bone[key])
                frame.append([*bone["Location"], *bone["Rotation"]])
            assert len(frame) == len(self.skeletons[subject])
            self.frames[subject] = frame


def receive(message, *avatars):
    """What the sample has after a message, and the same message of each of these avatars."""
    sample = SampleReceiver()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.setblocking(False)
        sender = livelink_json.LiveLinkJsonSender("127.0.0.1", receiver.getsockname()[1], ["long"])
        sender.send(EncodedHands(message))
        for name in avatars:
            sender.send_avatar(EncodedHands(message), HandProfile(name, {}))
        sender.close()
        with contextlib.suppress(BlockingIOError):
            while True:
                sample.take(receiver.recv(65536))
    return sample


def test_avatars_and_props_are_subjects_of_their_own():
    bodies = (
        BodyPose(True, np.array([0.1, 0.2, 0.3, 0.5, 0.5, 0.5, 0.5]), "Kännchen"),
        BodyPose(False, LIVE.bodies[0].pose, "lost"),
        BodyPose(True, LIVE.bodies[0].pose, "left_wrist"),
    )
    sample = receive(replace(LIVE, actor="a", bodies=bodies), "long", "uploaded")
    assert set(sample.frames) == {
        "ManipNet_a_left",
        "ManipNet_a_right",
        "ManipNet_a_long_left",
        "ManipNet_a_long_right",
        "ManipNet_a_prop_Kännchen",
    }
    assert sample.skeletons["ManipNet_a_prop_Kännchen"] == [("prop", -1)]
    np.testing.assert_allclose(sample.frames["ManipNet_a_prop_Kännchen"], [to_unreal(bodies[0].pose)], atol=1e-5)


def test_only_the_avatars_of_the_start_are_wanted():
    sender = livelink_json.LiveLinkJsonSender("127.0.0.1", 54321, ["long"])
    assert sender.wants("long")
    assert not sender.wants("uploaded")
    sender.close()
