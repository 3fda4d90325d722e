"""The Godot client in the real engine, Godot 3 without a window; the same files are meant for Godot 4."""

import json
import shutil
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from checkout import ROOT, need, publishing
from make_vectors import messages
from publisher import message

from manipnet.geometry import SIDES, Side, compose, invert, quat_exp, quat_rotate, quat_to_matrix
from manipnet.outputs.websocket.server import WebSocketPublisher
from manipnet.synthesis.hand.openxr import pose_in_world
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet.telemetry import Telemetry
from manipnet.wire import HandPose, HandsMessage, encode_binary

HERE = Path(__file__).parent / "godot3"
VECTORS = ROOT / "tests" / "vectors"
MODEL = shipped_hand()
ADDON = ROOT / "clients" / "godot" / "addons"
FINGERS = ((2, 3, 4, 5), *(tuple(range(7 + 5 * f, 11 + 5 * f)) for f in range(4)))
WORDS = ("Thumb", "Index", "Middle", "Ring", "Pinky")


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    folder = tmp_path_factory.mktemp("godot") / "project"
    shutil.copytree(HERE, folder)
    shutil.copytree(ADDON, folder / "addons")
    return folder


def command(project: Path, script: str, *arguments: str) -> list[str]:
    (godot,) = need("godot3-server")
    return [godot, "--path", str(project), "-s", f"res://{script}", *arguments]


def run(project: Path, script: str, *arguments: str) -> list[dict]:
    """What a script prints as JSON. Nothing may be wrong with any script."""
    done = subprocess.run(
        command(project, script, *arguments), capture_output=True, text=True, timeout=120, check=False, cwd=project
    )
    assert "SCRIPT ERROR" not in done.stdout + done.stderr, done.stdout + done.stderr
    return [json.loads(line[5:]) for line in done.stdout.splitlines() if line.startswith("JSON ")]


def test_golden_messages_are_read(project):
    good = {name: sent for name, sent in messages().items() if (VECTORS / f"{name}.bin").is_file()}
    found = run(project, "decode.gd", *(str(VECTORS / f"{name}.bin") for name in good))
    for (name, sent), read in zip(good.items(), found, strict=True):
        assert read["problem"] == "", name
        assert read["seq"] == sent.seq
        assert read["t_capture"] == pytest.approx(sent.t_capture)
        assert set(read["sides"]) == set(sent.hands)
        assert len(read["bodies"]) == len(sent.bodies)
        for body, expected in zip(read["bodies"], sent.bodies, strict=True):
            assert expected.name.startswith(body["name"])
            assert body["tracked"] == expected.tracked
            np.testing.assert_allclose(body["pose"], expected.pose, atol=1e-5)
        if "left" in sent.hands:
            hand = sent.hands["left"]
            np.testing.assert_allclose(read["left"]["joints"], hand.joints, atol=1e-4)
            assert (read["left"]["state"], read["left"]["object"]) == (hand.state, hand.object)


def test_broken_messages_are_refused(project):
    broken = sorted(VECTORS.glob("bad_*.bin"))
    broken.remove(VECTORS / "bad_nan_angle.bin")  # this client does not use the angles
    for file, read in zip(broken, run(project, "decode.gd", *map(str, broken)), strict=True):
        assert read["problem"] != "", file.name


def rig(lengths: float, name: str, seed: int):
    """Bones of both hands whose fingers are `lengths` times the model's, each bone with axes of its own."""
    rng = np.random.default_rng(seed)
    world: list[tuple[str, int, np.ndarray]] = [("Hips", -1, np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]))]
    straight = np.zeros((2, MODEL.angle_count))
    wrists = np.array([[0.5, 1.4, 0.2, *quat_exp(rng.normal(size=3))] for _ in SIDES])
    _, joints = pose_in_world(MODEL, SIDES, straight, wrists, 1.0)
    for side, of_hand in zip(SIDES, joints, strict=True):
        hand = len(world)
        world.append((f"{side.capitalize()}Hand", 0, of_hand[1]))
        for word, row in zip(WORDS, FINGERS, strict=True):
            parent, at = hand, of_hand[row[0], :3]
            for n, k in enumerate(row):
                if n:
                    at = at + lengths * (of_hand[k, :3] - of_hand[row[n - 1], :3])
                bone = name.format(side=side.capitalize(), word=word, n=n + 1)
                world.append((bone, parent, np.concatenate([at, quat_exp(rng.normal(size=3))])))
                parent = len(world) - 1
    bones = []
    for bone, parent, pose in world:
        local = pose if parent < 0 else compose(invert(world[parent][2]), pose)
        columns = quat_to_matrix(local[3:]).T.tolist()
        bones.append({"name": bone, "parent": parent, "basis": columns, "origin": local[:3].tolist()})
    return bones, {bone: pose for bone, _, pose in world}


def posed(seed: int) -> HandsMessage:
    rng = np.random.default_rng(seed)
    wrists = np.array([[*rng.normal(size=3), *quat_exp(rng.normal(size=3))] for _ in SIDES])
    angles = rng.uniform(*MODEL.limits.T, size=(2, MODEL.angle_count))
    rotations, joints = pose_in_world(MODEL, SIDES, angles, wrists, 1.0)
    hands: dict[Side, HandPose] = {
        side: HandPose("live", None, 1.0, angles[i], rotations[i], wrists[i], joints[i]) for i, side in enumerate(SIDES)
    }
    return HandsMessage("s", "actor", 1, 0.0, 0.0, 0.5, hands)


@pytest.mark.parametrize(
    ("name", "bone_map"),
    [
        ("mixamorig_{side}Hand{word}{n}", {}),
        ("{side}{word}_Knochen{n}", {f"{side}Hand{word}{n}": f"{side}{word}_Knochen{n}"
                                     for side in ("Left", "Right") for word in WORDS for n in (1, 2, 3)}),
    ],
    ids=["by its names", "by a map"],
)  # fmt: skip
def test_fingers_point_as_the_message_says_on_a_rig_of_other_proportions(project, tmp_path, name, bone_map):
    bones, rest = rig(1.3, name, 1)
    shown_message = posed(2)
    (tmp_path / "rig.json").write_text(json.dumps({"bones": bones, "map": bone_map}), encoding="utf-8")
    (tmp_path / "message.bin").write_bytes(encode_binary(shown_message))
    (shown,) = run(project, "drive.gd", str(tmp_path / "rig.json"), str(tmp_path / "message.bin"))
    assert shown["problem"] == ""
    assert shown["counts"] == {"left": 15, "right": 15}
    for side, hand in shown_message.hands.items():
        hand_bone = rest[f"{side.capitalize()}Hand"]
        for word, row in zip(WORDS, FINGERS, strict=True):
            names = [name.format(side=side.capitalize(), word=word, n=n) for n in (1, 2, 3, 4)]
            for n, (a, b) in enumerate(pairwise(row)):
                there = np.array(shown["places"][names[n + 1]]) - np.array(shown["places"][names[n]])
                found = quat_rotate(invert(hand_bone)[3:], there / np.linalg.norm(there))
                expected = quat_rotate(invert(hand.joints[1])[3:], hand.joints[b, :3] - hand.joints[a, :3])
                assert found @ expected / np.linalg.norm(expected) > np.cos(np.radians(1.0)), (side, word, n)


@contextmanager
def receiving(project: Path, *arguments: str) -> Iterator[Iterator[str]]:
    process = subprocess.Popen(command(project, "receive.gd", *arguments), stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        yield iter(process.stdout.readline, "")
    finally:
        process.kill()
        process.wait()
        if process.stdout is not None:
            process.stdout.close()


def first(lines: Iterator[str], word: str, count: int = 1) -> list[dict]:
    found = []
    while len(found) < count:
        line = next(lines)
        if line.startswith(word):
            found.append(json.loads(line[len(word) :]))
    return found


def test_messages_arrive_and_move_props_and_wrists_also_after_a_restart(project):
    with publishing("--token", "token-of-the-stage_2026") as (first_process, _, address):
        port = address.rpartition(":")[2]
        with receiving(project, f"address={address}", "token=token-of-the-stage_2026") as lines:
            got = first(lines, "JSON ", 30)
            assert [each["seq"] for each in got] == sorted({each["seq"] for each in got})
            assert got[-1]["state"] == "connected"
            x = got[-1]["joints"][1][0]
            np.testing.assert_allclose(got[-1]["wrist"], [x, 0.0, 0.0], atol=1e-5)
            np.testing.assert_allclose(got[-1]["prop"], [x, 0.0, 0.0], atol=1e-5)
            first_process.kill()
            first_process.wait()
            with publishing("--token", "token-of-the-stage_2026", "--websocket-port", port, "--session", "t"):
                while first(lines, "JSON ")[0]["session"] != "t":
                    pass


def test_an_avatar_is_uploaded_and_its_hands_are_received(project):
    requests = []

    def submit(request: bytes, reply: Callable[[bytes], object]) -> None:
        requests.append(json.loads(request))
        reply(b'{"name": "h\xc3\xa4nde"}')

    publisher = WebSocketPublisher(Telemetry(), "127.0.0.1", 0, submit=submit)
    try:
        arguments = f"address={publisher.address}", "hand=hände", 'profile={"name": "hände"}'
        with receiving(project, *arguments) as lines:
            assert first(lines, "ANSWER ") == [{"name": "hände"}]
            assert publisher.wants("hände")
            for seq in range(3):
                publisher.publish(encode_binary(message(seq, seq / 60, 0.1)), "hände")
                publisher.publish(encode_binary(message(100 + seq, seq / 60, 0.1)))  # the model's hand
            assert [each["seq"] for each in first(lines, "JSON ", 3)] == [0, 1, 2]
    finally:
        publisher.close()
    assert requests == [{"op": "hand_profile", "profile": {"name": "hände"}}]
