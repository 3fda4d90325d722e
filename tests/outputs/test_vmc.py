"""VMC: bytes against the OSC specification, poses against a T-pose worked out by hand, and an independent reader."""

import contextlib
import io
import select
import socket
import subprocess
import time
from dataclasses import replace

import numpy as np
from checkout import need
from make_vectors import messages
from pythonosc.osc_bundle import OscBundle

from manipnet.geometry import matrix_to_quat, mirror_quats, quat_conjugate, quat_exp, quat_multiply, quat_rotate
from manipnet.net.osc import osc_message
from manipnet.outputs.declaration import EncodedHands
from manipnet.outputs.vmc.bundle import HandBundle
from manipnet.outputs.vmc.sender import VmcSender
from manipnet.outputs.vmc.skeleton import FOREARM_M, VmcSkeleton, bone_names
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.wire import HandPose

HAND = shipped_hand()
IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
HALF = np.sqrt(0.5)
PLAIN = VmcSkeleton(HAND, rest_pose_correction=False)
CORRECTED = VmcSkeleton(HAND)


def local_rotations(angles, bent=None, by=IDENTITY):
    """Local rotations `(17, 4)` of a right hand at `angles`; the bone `bent` turned by `by` in the wrist frame."""
    world = matrix_to_quat(forward_kinematics(HAND, angles)[1])
    if bent is not None:
        world[bent] = quat_multiply(by, world[bent])
    local = world.copy()
    local[1:] = quat_multiply(quat_conjugate(world[HAND.parents[1:17]]), world[1:])
    return local


def hand(rotations, wrist_q=IDENTITY):
    wrist = np.array([0.0, 1.0, 0.0, *wrist_q])
    return HandPose("live", None, 1.0, np.zeros(20), rotations, wrist, np.tile(wrist, (26, 1)))


def poses_by_name(skeleton, side, pose):
    return dict(zip(bone_names(side), skeleton.bone_poses(side, pose), strict=True))


def hand_bundle(side, pose, t_s):
    return HandBundle(bone_names(side)).filled(t_s, PLAIN.bone_poses(side, pose))


def test_bytes_are_those_of_the_osc_specification():
    assert osc_message("/oscillator/4/frequency", "f", 440.0).dgram == bytes.fromhex(
        "2f6f7363696c6c61746f722f342f6672657175656e6379002c66000043dc0000"
    )
    assert osc_message("/foo", "iisff", 1000, -1, "hello", 1.234, 5.678).dgram == bytes.fromhex(
        "2f666f6f000000002c69697366660000000003e8ffffffff68656c6c6f0000003f9df3b640b5b22d"
    )


def test_a_bundle_fits_a_packet_and_has_what_the_specification_asks_for():
    bundle = hand_bundle("right", messages()["live"].hands["right"], 1.5)
    assert len(bundle) + 28 <= 1500
    assert bundle[:16] == b"#bundle\0" + bytes(7) + b"\x01"
    assert bundle[20:40] == b"/VMC/Ext/OK\0,i\0\0" + b"\0\0\0\x01"
    assert bundle[44:64] == b"/VMC/Ext/T\0\0,f\0\0" + b"\x3f\xc0\0\0"
    assert bundle[68:100] == b"/VMC/Ext/Bone/Pos\0\0\0,sfffffff\0\0\0"
    assert bundle[-28:] == b"/VMC/Ext/Blend/Apply\0\0\0\0,\0\0\0"
    names = [m.params[0] for m in OscBundle(bundle) if m.address == "/VMC/Ext/Bone/Pos"]
    assert len(set(names)) == 16
    assert {"RightHand", "RightThumbProximal", "RightLittleDistal"} <= set(names)


def test_a_bundle_carries_the_poses_of_its_bones_in_their_order():
    hand = messages()["live"].hands["left"]
    bundle = OscBundle(hand_bundle("left", hand, 1.5))
    sent = {m.params[0]: m.params[1:] for m in bundle if m.address == "/VMC/Ext/Bone/Pos"}
    poses = poses_by_name(PLAIN, "left", hand)
    assert list(sent) == list(poses)
    np.testing.assert_allclose(list(sent.values()), list(poses.values()), atol=1e-6)


def test_angle_zero_is_the_t_pose_without_correction():
    poses = poses_by_name(PLAIN, "right", hand(local_rotations(np.zeros(20))))
    turned = [name for name, pose in poses.items() if abs(pose[3:] @ IDENTITY) < 1 - 1e-6]
    assert turned == ["RightHand"]  # this wrist is not in T-pose


def test_a_finger_bent_by_a_right_angle():
    """T-pose, palm down, Unity: a right finger points to +x and curls to -y, a left one to -x and curls to -y."""
    bent = local_rotations(np.zeros(20), bent=6, by=quat_exp(np.array([0.0, np.pi / 2, 0.0])))
    right = poses_by_name(PLAIN, "right", hand(bent))
    left = poses_by_name(PLAIN, "left", hand(mirror_quats(bent)))
    np.testing.assert_allclose(right["RightIndexIntermediate"][3:], [0, 0, -HALF, HALF], atol=1e-4)
    np.testing.assert_allclose(left["LeftIndexIntermediate"][3:], [0, 0, HALF, HALF], atol=1e-4)
    np.testing.assert_allclose(right["RightIndexProximal"][3:], IDENTITY, atol=1e-4)
    assert right["RightIndexIntermediate"][0] > 0 > left["LeftIndexIntermediate"][0]


def test_wrists_in_t_pose_do_not_turn_the_hand():
    """A right wrist with fingers to -x, thumb to +z, back up in the project frame is the T-pose itself."""
    t_pose = matrix_to_quat(np.array([[-1.0, 0, 0], [0, 0, 1.0], [0, 1.0, 0]]))
    flat = local_rotations(np.zeros(20))
    right = poses_by_name(PLAIN, "right", hand(flat, t_pose))["RightHand"]
    left = poses_by_name(PLAIN, "left", hand(mirror_quats(flat), mirror_quats(t_pose)))["LeftHand"]
    np.testing.assert_allclose(right, [FOREARM_M, 0, 0, 0, 0, 0, 1], atol=1e-9)
    np.testing.assert_allclose(left, [-FOREARM_M, 0, 0, 0, 0, 0, 1], atol=1e-9)


def test_rest_pose_correction_makes_bones_point_where_the_hand_does():
    angles = np.linspace(0.0, 0.9, 20)
    positions, _ = forward_kinematics(HAND, angles)
    poses = poses_by_name(CORRECTED, "right", hand(local_rotations(angles)))
    for finger, joints in (("Thumb", (2, 3, 4, 17)), ("Little", (14, 15, 16, 21))):
        turn = IDENTITY
        straight = [HALF, 0.0, HALF] if finger == "Thumb" else [1.0, 0.0, 0.0]  # Unity: thumbs 45 degrees to the front
        for part, start, end in zip(("Proximal", "Intermediate", "Distal"), joints[:-1], joints[1:], strict=True):
            turn = quat_multiply(turn, poses[f"Right{finger}{part}"][3:])
            x, y, z = (positions[end] - positions[start]) / np.linalg.norm(positions[end] - positions[start])
            np.testing.assert_allclose(quat_rotate(turn, np.array(straight)), [x, z, y], atol=1e-6)


def received(*messages, **options):
    """The datagrams that a sender with these options sends for messages."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.setblocking(False)
        sender = VmcSender("127.0.0.1", receiver.getsockname()[1], HAND, **options)
        sent = [sender.send(EncodedHands(message)) for message in messages]
        sender.close()
        datagrams = []
        with contextlib.suppress(BlockingIOError):
            while True:
                datagrams.append(OscBundle(receiver.recv(2048)))
    return sent, datagrams


def test_fingers_only_leave_the_hand_to_the_body_stream():
    message = messages()["live"]
    _, datagrams = received(message, fingers_only=True)
    sent = {m.params[0]: m.params[1:] for bundle in datagrams for m in bundle if m.address == "/VMC/Ext/Bone/Pos"}
    assert len(sent) == 30
    assert not {"LeftHand", "RightHand"} & set(sent)
    expected = poses_by_name(CORRECTED, "right", message.hands["right"])["RightThumbDistal"]
    np.testing.assert_allclose(sent["RightThumbDistal"], expected, atol=1e-5)


def test_one_receiver_gets_one_actor():
    first = messages()["live"]
    other = replace(first, actor="other")
    sent, datagrams = received(first, other)
    assert sent == [True, False]
    assert len(datagrams) == 2
    assert received(first, other, actor="other")[0] == [False, True]


def test_each_datagram_is_applied_and_carries_the_time():
    message = messages()["live"]
    _, datagrams = received(message, replace(message, t_publish=message.t_publish + 0.5))
    assert all([m.address for m in bundle][-1] == "/VMC/Ext/Blend/Apply" for bundle in datagrams)
    times = [m.params[0] for bundle in datagrams for m in bundle if m.address == "/VMC/Ext/T"]
    assert times == [0.0, 0.0, 0.5, 0.5]


def test_read_by_an_independent_osc_tool():
    (oscdump,) = need("oscdump")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    process = subprocess.Popen([oscdump, "-L", str(port)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert isinstance(process.stdout, io.BufferedReader)
    sender, message = VmcSender("127.0.0.1", port, HAND), messages()["live"]
    try:
        text, give_up = b"", time.monotonic() + 20
        while text.count(b"/VMC/Ext/Bone/Pos") < 32 and time.monotonic() < give_up:
            sender.send(EncodedHands(message))  # again and again: the tool does not tell when it listens
            while select.select([process.stdout], [], [], 0.05)[0]:
                text += process.stdout.read1(65536)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
        sender.close()
    lines = [line.split() for line in text.decode().splitlines()]
    expected = poses_by_name(CORRECTED, "right", message.hands["right"])["RightIndexProximal"]
    row = next(line for line in lines if '"RightIndexProximal"' in line)
    assert row[1:3] == ["/VMC/Ext/Bone/Pos", "sfffffff"]
    np.testing.assert_allclose([float(x) for x in row[4:]], expected, atol=1e-5)
    assert ["/VMC/Ext/OK", "i", "1"] in [line[1:4] for line in lines]
