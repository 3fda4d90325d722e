"""Hands of avatars in the clients for engines: the profile that they make of a rig, and the rig that they pose with it.

Both cores, C# for Unity and C++ for Unreal, upload profiles of synthetic characters to a real server, receive the hands
that it solves on them, and turn the characters' bones. Every fingertip must be where the message says.
"""

import json
import threading
import time

import numpy as np
import pytest
from avatar_rigs import KINDS, Rig, avatar_rig, rest_of
from checkout import VECTORS
from languages import LiveClient, run
from live_server import Stage, scene, serving
from make_hand_profiles import vectors
from manipnet_client.avatar import AvatarHand, RigHand

from manipnet.geometry import SIDES, Side, quat_conjugate, quat_multiply, quat_rotate
from manipnet.outputs.axes import to_unity, to_unreal
from manipnet.wire.rig_names import FINGER_PATTERNS, METACARPAL_PATTERNS, find_bones, finger_names, metacarpal_names

ENGINES = {"csharp": (to_unity, 1.0), "gcc-sanitized": (to_unreal, 0.01)}
"""For each core the axes of its engine, and its unit in metres."""
AGREEMENT_M = 0.0005
TIP_M = 0.001
PATIENCE_S = 60.0


@pytest.fixture(params=ENGINES)
def language(request):
    return request.param


@pytest.fixture(scope="module")
def unreal(harness):
    return harness("unreal-avatar")


def rests(language, kind, seed=0):
    to_engine, _ = ENGINES[language]
    return {side: rest_of(avatar_rig(kind, seed), kind, side, to_engine) for side in SIDES}


def test_the_vectors_are_those_of_the_import():
    assert (VECTORS / "hand_profiles.json").read_text(encoding="utf-8") == vectors(), (
        "run tests/vectors/make_hand_profiles.py"
    )


@pytest.mark.parametrize("kind", KINDS)
def test_profiles_agree_with_those_of_the_import(harness, language, kind):
    hands = rests(language, kind)
    lines = run(harness(language), "profile", text="".join(hand.line() + "\n" for hand in hands.values()))
    agree(kind, {side: json.loads(line)[side]["joints"] for side, line in zip(hands, lines, strict=True)})


@pytest.mark.parametrize("kind", KINDS)
def test_profiles_of_the_python_client_agree_with_those_of_the_import(kind):
    profiles = {}
    for side in SIDES:
        rest = rest_of(avatar_rig(kind), kind, side, lambda pose: pose)
        rows = [
            np.array([part.get(k, np.full(width, np.nan)) for k in range(first, count)])
            for part, width, first, count in (
                *((rest.positions, 3, 0, 15), (rest.rotations, 4, 0, 15)),
                *((rest.tips, 3, 0, 5), (rest.metacarpals, 3, 1, 5)),
            )
        ]
        rig = RigHand(rows[0], rows[1], rows[2], metacarpals=rows[3])
        profiles[side] = AvatarHand(side, rig).content()["joints"]
    agree(kind, profiles)


def agree(kind, profiles):
    expected = json.loads((VECTORS / "hand_profiles.json").read_text(encoding="utf-8"))[kind]["profile"]
    for side, found in profiles.items():
        assert [row is None for row in found] == [row is None for row in expected[side]["joints"]]
        ours, theirs = (np.array([row for row in rows if row], float) for rows in (found, expected[side]["joints"]))
        np.testing.assert_allclose(ours[:, :3], theirs[:, :3], atol=AGREEMENT_M)
        for axis in np.eye(3):
            np.testing.assert_allclose(quat_rotate(ours[:, 3:], axis), quat_rotate(theirs[:, 3:], axis), atol=5e-3)


def test_bones_are_found_as_the_import_finds_them(harness, language):
    """For each pattern of names a whole rig, with names of two programs in some, a prefix, and lists in any order."""
    rng, rigs = np.random.default_rng(3), [avatar_rig(kind).names for kind in KINDS]
    for k in range(len(FINGER_PATTERNS)):
        names = [
            candidates[min(k, len(candidates) - 1)]
            for side in SIDES
            for finger in range(5)
            for candidates in (
                *(finger_names(side, finger, part) for part in range(3)),
                metacarpal_names(side, finger)[: len(METACARPAL_PATTERNS)],
            )
        ]
        rigs += [names, [f"Anna_{name}" for name in names], [*names, *rigs[k % len(KINDS)]]]
    rigs += [["Thumb0_L", "Thumb1_L", "Thumb2_L", "Left wrist"], ["LeftThumbProximal", "LeftThumbMetacarpal"], ["Hips"]]
    rigs = [[names[i] for i in rng.permutation(len(names))] for names in rigs]
    questions: list[tuple[Side, list[str]]] = [(side, names) for names in rigs for side in SIDES]
    lines = run(harness(language), "find", text="".join("\t".join([s, *names]) + "\n" for s, names in questions))
    for line, (side, names) in zip(lines, questions, strict=True):
        found = find_bones(names)[side]
        at = lambda name, names=names: -1 if name is None else names.index(name)  # noqa: E731
        expected = [at(found.hand), *(at(found.fingers.get((b // 3, b % 3))) for b in range(15))]
        expected += [at(found.metacarpals.get(finger)) for finger in range(1, 5)]
        assert [int(word) for word in line.split()] == expected, names


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda rest: {k: -p for k, p in rest.positions.items()}, "wrong side"),
        (lambda rest: {k: 0 * p for k, p in rest.positions.items()}, "in one place"),
        (lambda rest: {k: p for k, p in rest.positions.items() if k < 6 and k > 2}, "only one finger"),
    ],
)
def test_bones_that_are_no_hand_are_refused_with_the_remedy(harness, language, change, reason):
    rest = rests(language, "mixamo")["left"]
    positions = change(rest)
    for kept, there in ((rest.bones, positions), (rest.positions, positions)):
        for bone in list(kept):
            if bone not in there:
                del kept[bone]
            elif kept is rest.positions:
                rest.positions[bone] = positions[bone]
    (line,) = run(harness(language), "profile", text=rest.line() + "\n")
    assert line.startswith("error: the left hand ")
    assert reason in line


class Performance:
    """Sends bodies in real time in a thread, as a tracker does."""

    def __init__(self, stage: Stage) -> None:
        self._stage, self._ending = stage, threading.Event()
        stage.start_s += 1000.0
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        begin = time.monotonic()
        while not self._ending.wait(1 / 120):
            t = time.monotonic() - begin
            self._stage.sender.send(self._stage.start_s + t, scene(t))

    def end(self) -> None:
        self._ending.set()
        self._thread.join()


@pytest.fixture
def performance(stage):
    playing = Performance(stage)
    yield playing
    playing.end()


def start(command, server, hands, name):
    words = [*command, "avatar", server.addresses["hands"], server.addresses["control"], name]
    client = LiveClient.run(words)
    assert client.process.stdin is not None
    client.process.stdin.write("".join(hands[side].line() + "\n" for side in SIDES))
    client.process.stdin.flush()
    return client


def shown_when(client, ready):
    """The first answer of which `ready` is true."""
    until = time.monotonic() + PATIENCE_S
    while not ready(shown := client.ask()):
        assert time.monotonic() < until, shown
        time.sleep(0.02)
    return shown


def is_a_hand(joints, rest, unit):
    """Whether the bones in a message have the lengths of the rig's.

    What a client shows is a mean of frames. It is not exactly a hand where the hand jumps from one frame to the next,
    as that of the tests' small model sometimes does.
    """
    places = np.array(joints).reshape(26, 7)[:, :3]
    for bone, place in rest.positions.items():
        joint = 2 + bone if bone < 3 else 2 + 5 * (bone // 3) + bone % 3
        later = [k for k in rest.bones if bone < k < 3 * (bone // 3) + 3]
        after = joint + later[0] - bone if later else 5 + 5 * (bone // 3)
        length = unit * np.linalg.norm(rest.end_of(bone) - place)
        if abs(np.linalg.norm(places[after] - places[joint]) - length) > 1e-4:
            return False
    return True


@pytest.mark.parametrize("kind", KINDS)
def test_fingertips_are_where_the_message_says(harness, language, stage, performance, kind):
    to_engine, unit = ENGINES[language]
    hands = rests(language, kind, seed=1)
    client = start(harness(language), stage.server, hands, f"{kind}-{language}")
    try:
        shown_when(client, lambda s: s["received"] > 30 and s["weight"] == 1 and "left" in s and "right" in s)
        for _ in range(10):
            shown = shown_when(client, lambda s: all(is_a_hand(s[side]["joints"], hands[side], unit) for side in SIDES))
            for side, rest in hands.items():
                hand = {key: np.array(value) for key, value in shown[side].items()}
                joints = np.array([to_engine(joint) for joint in hand["joints"].reshape(26, 7)])
                placed = {
                    k: hand["hand"][:3] + quat_rotate(hand["hand"][3:], p)
                    for k, p in rest.pose(hand["bones"].reshape(15, 4)).items()
                }
                for k, place in placed.items():
                    finger, part = (k // 3, k % 3) if k < 15 else (k - 15, 3)
                    joint = 2 + part if finger == 0 else 2 + 5 * finger + part
                    assert unit * np.linalg.norm(place - joints[joint, :3]) < TIP_M, (side, k)
                assert len(placed) == len(rest.bones) + (3 if kind == "cartoon" else 5)
            time.sleep(0.05)
    finally:
        client.kill()


@pytest.mark.parametrize(("kind", "scale"), [("mixamo", 0.01), ("cartoon", 1.0), ("metahuman", 1.0)])
def test_unity_components_put_the_fingertips_where_the_message_says(harness, stage, performance, kind, scale):
    rig = avatar_rig(kind, seed=2)
    poses = [to_unity(np.hstack(pose)) for pose in zip(rig.positions, rig.rotations, strict=True)]
    lines = [f"{scale} {len(poses)}"]
    for name, parent, pose in zip(rig.names, rig.parents, poses, strict=True):
        lines.append("\t".join([name, str(parent), *(repr(float(x)) for x in pose)]))
    addresses = stage.server.addresses
    client = LiveClient.run([*harness("unity"), addresses["hands"], addresses["control"]])
    assert client.process.stdin is not None
    client.process.stdin.write("\n".join(lines) + "\n")
    try:
        hands = {side: rest_of(rig, kind, side, to_unity) for side in SIDES}
        shown = shown_when(
            client,
            lambda s: s["solved"] and s["weight"] == 1 and all(is_a_hand(s[k], hands[k], 1.0) for k in SIDES),
        )
        assert f"Stream: {rig.names[0]}_" in shown["drawn"]
        assert "State: connected" in shown["drawn"]
        places = np.array(shown["bones"]).reshape(-1, 3)
        for side in SIDES:
            joints = np.array([to_unity(joint) for joint in np.array(shown[side]).reshape(26, 7)])
            rest = hands[side]
            for bone, k in rest.bones.items():
                joint = 2 + bone if bone < 3 else 2 + 5 * (bone // 3) + bone % 3
                assert np.linalg.norm(places[k] - joints[joint, :3]) < TIP_M, rig.names[k]
            for finger in rest.tips:
                name = max(n for n, above in enumerate(rig.parents) if above == rest.bones[last_bone(rest, finger)])
                assert np.linalg.norm(places[name] - joints[5 + 5 * finger, :3]) < TIP_M, rig.names[name]
    finally:
        client.kill()


@pytest.mark.parametrize(("kind", "scale"), [("manny", 1.0), ("metahuman", 1.0), ("mixamo", 0.01)])
def test_unreal_asset_puts_the_fingertips_where_the_message_says(unreal, stage, performance, kind, scale):
    """The retarget asset only turns bones, so that all places are relative to the hand bone."""
    rig = avatar_rig(kind, seed=3)
    client = unreal_character(unreal, stage.server, rig, scale)
    hands = {side: rest_of(rig, kind, side, to_unreal) for side in SIDES}
    subjects = {side: f"ManipNet_actor_Bob_{side}" for side in SIDES}
    try:
        for _ in range(5):
            shown = shown_when(client, lambda s: all(is_subject(s, subjects[k], hands[k]) for k in SIDES))
            places = np.array(shown["bones"]).reshape(-1, 3)
            for side, rest in hands.items():
                joints = subject_joints(shown[subjects[side]])
                wrist = places[rig.parents[rest.bones[0]]]
                for bone, k in rest.bones.items():
                    joint = 2 + bone if bone < 3 else 2 + 5 * (bone // 3) + bone % 3
                    assert np.linalg.norm(places[k] - wrist - joints[joint] + joints[1]) < 100 * TIP_M, rig.names[k]
                for finger in rest.tips:
                    tip = rig.parents.index(rest.bones[last_bone(rest, finger)])
                    off = places[tip] - wrist - joints[5 + 5 * finger] + joints[1]
                    assert np.linalg.norm(off) < 100 * TIP_M, rig.names[tip]
        assert "Hz" in shown["status"]
    finally:
        client.kill()


def unreal_character(command, server, rig, scale, mesh="/Game/Bob.Bob"):
    """The plugin with a source for a skeletal mesh, whose root has a scale."""
    poses = [to_unreal(np.hstack(pose)) for pose in zip(rig.positions, rig.rotations, strict=True)]
    lines = [f"/Game/Bob.Bob {len(poses)}"]
    for name, parent, pose in zip(rig.names, rig.parents, poses, strict=True):
        above = poses[parent] if parent >= 0 else np.array([0.0, 0, 0, 0, 0, 0, 1])
        back = quat_conjugate(above[3:])
        local = quat_rotate(back, pose[:3] - above[:3]) / (1.0 if parent < 0 else scale)
        numbers = [*local, *quat_multiply(back, pose[3:]), scale if parent < 0 else 1.0]
        lines.append(" ".join([name, str(parent), *(repr(float(x)) for x in numbers)]))
    hands, control = (server.addresses[what] for what in ("hands", "control"))
    text = f"{hands} delay=0.05 control={control.rpartition(':')[2]} avatar={mesh}"
    client = LiveClient.run([*command, text])
    assert client.process.stdin is not None
    client.process.stdin.write("\n".join(lines) + "\n")
    return client


def subject_joints(values):
    """The places of OpenXR's joints; in a subject the wrist comes before the palm."""
    places = np.array(values).reshape(26, 3)
    return places[[1, 0, *range(2, 26)]]


def is_subject(shown, subject, rest):
    if subject not in shown:
        return False
    joints = np.hstack([subject_joints(shown[subject]), np.zeros((26, 4))])
    return is_a_hand(0.01 * joints, rest, 0.01)


def test_unreal_source_says_why_it_cannot_solve_on_an_avatar(unreal, stage):
    client = unreal_character(unreal, stage.server, avatar_rig("manny"), 1.0, "/Game/Other.Other")
    try:
        assert client.ask()["status"] == (
            "the avatar /Game/Other.Other cannot be loaded; choose a skeletal mesh of this project"
        )
    finally:
        client.kill()
    rig = Rig(["root"], [-1], [np.zeros(3)], [np.array([0.0, 0.0, 0.0, 1.0])])
    client = unreal_character(unreal, stage.server, rig, 1.0)
    try:
        assert client.ask()["status"].startswith("the avatar has no hands: left hand: no bone for hand, thumb")
    finally:
        client.kill()


def test_unreal_nodes_control_the_server(unreal, stage):
    client = unreal_character(unreal, stage.server, avatar_rig("manny"), 1.0)
    address = stage.server.addresses["control"]
    to_client, from_client = client.process.stdin, client.process.stdout
    assert to_client is not None
    assert from_client is not None

    def ask(words, to=address):
        to_client.write(f"request {to} {words}\n")
        to_client.flush()
        return from_client.readline().rstrip("\n")

    try:
        pin, reply = ask("pause").split(" ", 1)
        assert (pin, json.loads(reply)["paused"]) == ("replied", True)
        assert ask('{"op": "pause", "on": false}').startswith("replied {")
        assert ask("record").startswith("refused ")
        assert ask("record").count("--takes") == 1, "the server of this test keeps no takes, and says so"
        assert 'mug \\"x\\"' in ask("select") or "mug" in ask("select")
        assert ask("{").startswith("refused ")
        assert ask("stop", "tcp://127.0.0.1:1") == "refused no server answers at 127.0.0.1:1"
        assert ask("stop", "udp://x").startswith("refused the address is")
    finally:
        client.kill()


def last_bone(rest, finger):
    return max(bone for bone in rest.bones if bone // 3 == finger)


def test_a_refusal_of_the_server_is_shown(harness, language, stage, performance):
    hands = rests(language, "mixamo")
    client = start(harness(language), stage.server, hands, "a/b")
    try:
        state = shown_when(client, lambda s: s["state"].startswith("the server refused"))["state"]
    finally:
        client.kill()
    assert state == (
        "the server refused the hand profile: name 'a/b' cannot be part of a topic: it must not contain spaces, "
        "slashes or control characters"
    )


def test_the_profile_is_uploaded_again_after_a_restart(harness, language, tiny_bundle):
    hands, ports = rests(language, "manny"), []
    options = ("--model", str(tiny_bundle))
    with serving(*options) as first:
        ports = [
            f"--{flag}={first.addresses[what].rpartition(':')[2]}"
            for flag, what in (("port", "hands"), ("control-port", "control"))
        ]
        client = start(harness(language), first, hands, "again")
        stage = Stage(first)
        playing = Performance(stage)
        try:
            before = shown_when(client, lambda s: s["received"] > 10)["received"]
        finally:
            playing.end()
            stage.close()
    try:
        with serving(*options, *ports) as second:
            stage = Stage(second)
            playing = Performance(stage)
            try:
                shown_when(client, lambda s: s["received"] > before + 30)
            finally:
                playing.end()
                stage.close()
    finally:
        client.kill()
