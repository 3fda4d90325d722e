"""Unreal: fingers and wrists on characters of several skeletons, through the retarget asset on stubs of the engine.

The stubs stand in for Live Link and the pose of an animation graph; the mathematics is the plugin's own.
"""

import json
import subprocess
from dataclasses import dataclass, field

import numpy as np
import pytest
from checkout import ROOT, need
from languages import CPP, run
from random_hand import posed
from test_retarget import BONE_NAMES, foreign_rig, shown_directions
from unreal_headers import MODULE, write_headers

from manipnet.geometry import quat_conjugate, quat_exp, quat_multiply, quat_rotate
from manipnet.outputs.axes import to_unreal
from manipnet.outputs.livelink.sender import hand_json

FINGERS = ("thumb", "index", "middle", "ring", "pinky")
UNTOUCHED = [0, 1, 2, 7]
"""Columns of a local pose that no retarget may change: the position and the scale."""
IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
METRES = 100.0
"""A rig of the tests has its proportions in metres; Unreal's are in centimetres."""


def manny(side, finger, part):
    return f"{finger}_0{part + 1}_{side[0]}"


def mixamo(side, finger, part):
    return f"mixamorig:{side.capitalize()}Hand{finger.capitalize()}{part + 1}"


def nameless(side, finger, part):
    return f"bone{'lr'.index(side[0])}{FINGERS.index(finger)}{part}"


SKELETONS = {
    "manny": (manny, "hand_{0}", ("upperarm_{0}", "lowerarm_{0}")),
    "metahuman": (manny, "hand_{0}", ("upperarm_{0}", "lowerarm_{0}")),
    "mixamo": (mixamo, "mixamorig:{1}Hand", ("mixamorig:{1}Arm", "mixamorig:{1}ForeArm")),
    "mapped": (nameless, "palm{0}", ("arm{0}", "elbow{0}")),
}


@dataclass
class Skeleton:
    """Bones with their local rest poses, as `(name, parent, position (3,), quaternion (4,), scale)`."""

    bones: list = field(default_factory=list)

    def add(self, name, parent, position, rotation=IDENTITY, scale=1.0):
        self.bones.append((name, parent, np.asarray(position, float), np.asarray(rotation, float), scale))
        return len(self.bones) - 1

    def index(self, name):
        return [bone[0] for bone in self.bones].index(name)


def world(bones, parents):
    """Positions, rotations and scales of bones in the space of the character, from local poses `(N, 8)`."""
    out = []
    for local, parent in zip(bones, parents, strict=True):
        position, rotation, scale = local[:3], local[3:7], local[7]
        if parent >= 0:
            p, q, s = out[parent]
            position, rotation, scale = p + quat_rotate(q, s * position), quat_multiply(q, rotation), s * scale
        out.append((position, rotation, scale))
    return out


@dataclass
class Character:
    """A skeleton with one hand, and what of it the test must know."""

    skeleton: Skeleton
    rig: tuple
    hand: int
    arm: tuple
    names: list


def character(kind, side, rng, left_out=()):
    """A body with one arm; the fingers have random axes, and a MetaHuman's have a metacarpal bone before them."""
    name_of, hand_name, arm_names = SKELETONS[kind]
    words = (side[0], side.capitalize())
    positions, rotations, tips, turn = foreign_rig(side, rng, mirrored=True)
    skeleton = Skeleton()
    turned = lambda: quat_exp(rng.normal(size=3))  # noqa: E731
    root = skeleton.add("root", -1, [0, 0, 0], scale=METRES)
    spine = skeleton.add("spine", root, [0.0, 0.0, 1.2], turned())
    upper = skeleton.add(arm_names[0].format(*words), spine, [0.2, 0.0, 0.1], turned())
    lower = skeleton.add(arm_names[1].format(*words), upper, [0.28, 0.0, 0.02], turned())
    skeleton.add("lowerarm_twist", lower, [0.1, 0.0, 0.0], turned())
    hand = skeleton.add(hand_name.format(*words), lower, [0.25, 0.02, 0.0], turned())
    names = []
    for i in range(15):
        finger, part = divmod(i, 3)
        name = name_of(side, FINGERS[finger], part)
        names.append(name)
        if name in left_out:
            continue
        before = [k for k in range(i - part, i) if names[k] not in left_out]
        if before:
            parent, p, q = skeleton.index(names[before[-1]]), positions[before[-1]], rotations[before[-1]]
        elif kind == "metahuman" and finger > 0:
            p, q = 0.3 * positions[i], quat_exp(rng.normal(size=3))
            parent = skeleton.add(f"{FINGERS[finger]}_metacarpal_{side[0]}", hand, p, q)
        else:
            parent, p, q = hand, np.zeros(3), IDENTITY
        back = quat_conjugate(q)
        skeleton.add(name, parent, quat_rotate(back, positions[i] - p), quat_multiply(back, rotations[i]))
        if part == 2 and kind != "manny":
            skeleton.add(
                f"{name}_end",
                len(skeleton.bones) - 1,
                quat_rotate(quat_conjugate(rotations[i]), tips[finger] - positions[i]),
            )
    return Character(skeleton, (positions, rotations, tips, turn), hand, (upper, lower), names)


@pytest.fixture(scope="module")
def retarget(tmp_path_factory):
    (compiler,) = need("g++")
    folder = tmp_path_factory.mktemp("character")
    exe = folder / "character"
    own = ("ManipNetRetargetAsset.cpp", "ManipNetSkeletons.cpp")
    sources = [*(MODULE / "Private" / name for name in own), *CPP.glob("*.cpp")]
    options = ["-pthread", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-o", str(exe)]
    sources = [*sources, ROOT / "tests" / "clients" / "cpp" / "character.cpp"]
    subprocess.run([compiler, *write_headers(folder), *options, *map(str, sources)], check=True)

    def call(made, side, joints, what="fingers", bone_map="", lod=None, weight=1.0):
        lines = [what, bone_map, str(len(made.skeleton.bones))]
        lines += [f"{n} {parent} {_row(p)} {_row(q)} {s}" for n, parent, p, q, s in made.skeleton.bones]
        lod = list(range(len(made.skeleton.bones))) if lod is None else lod
        lines += [str(len(lod)), " ".join(map(str, lod)), str(weight)]
        (subject,) = json.loads(hand_json(f"a_{side}", joints)).values()
        lines += [f"{b['Name']} {b['Parent']} {_row(b['Location'])} {_row(b['Rotation'])}" for b in subject]
        done = subprocess.run(
            [str(exe)], input="\n".join(lines) + "\n", capture_output=True, encoding="utf-8", timeout=60
        )
        assert done.returncode == 0, done.stderr
        return np.array([line.split() for line in done.stdout.splitlines()], float), done.stderr

    return call


def _row(values):
    return " ".join(str(float(x)) for x in values)


def rest_of(made):
    return np.array([[*p, *q, s] for _, _, p, q, s in made.skeleton.bones])


def finger_rotations(made, shown):
    """Rotations of the present finger bones in the space of the hand, by their place in the rig."""
    poses = world(shown, [bone[1] for bone in made.skeleton.bones])
    back = quat_conjugate(poses[made.hand][1])
    return {
        i: quat_multiply(back, poses[made.skeleton.index(name)][1])
        for i, name in enumerate(made.names)
        if name in {bone[0] for bone in made.skeleton.bones}
    }


def bone_map(made, side):
    """The map of a skeleton whose names mean nothing, in the names of Mixamo."""
    scheme = {
        mixamo(side, FINGERS[i // 3], i % 3).removeprefix("mixamorig:"): name for i, name in enumerate(made.names)
    }
    return json.dumps(scheme | {f"{side.capitalize()}Hand": f"palm{side[0]}"})


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("kind", SKELETONS)
def test_fingers_point_where_the_hand_does(retarget, kind, side):
    rng = np.random.default_rng(3)
    message, along = posed(side, rng)
    made = character(kind, side, rng)
    positions, rotations, tips, turn = made.rig
    shown, log = retarget(
        made, side, message.hands[side].joints, bone_map=bone_map(made, side) if kind == "mapped" else ""
    )
    assert log == ""
    found = finger_rotations(made, shown)
    if kind == "manny":  # it has no bones at the tips, so that its last bones continue the ones before
        tips = positions[2::3] + (positions[2::3] - positions[1::3])
    directions = shown_directions(positions, rotations, tips, np.array([found[i] for i in range(15)]))
    np.testing.assert_allclose(directions, quat_rotate(turn, along * [-1, 1, 1]), atol=2e-5)
    rest, fingers = rest_of(made), [made.skeleton.index(name) for name in made.names]
    np.testing.assert_allclose(
        shown[:, [0, 1, 2, 7]], rest[:, [0, 1, 2, 7]], err_msg="positions and scales must not change"
    )
    others = np.setdiff1d(np.arange(len(rest)), fingers)
    np.testing.assert_allclose(shown[others], rest[others], err_msg="only fingers may turn")


@pytest.mark.parametrize("side", ["left", "right"])
def test_wrist_and_arm_follow_with_the_same_algorithm_as_the_other_clients(retarget, side):
    rng = np.random.default_rng(4)
    message, _ = posed(side, rng)
    made = character("manny", side, rng)
    turn = made.rig[3]
    at = world(rest_of(made), [bone[1] for bone in made.skeleton.bones])
    target = at[made.arm[0]][0] + np.array([20.0, 15.0, 10.0])  # the arm reaches 53 cm
    joints = message.hands[side].joints.copy()
    x, y, z = target / 100.0
    joints[:, :3] += np.array([-y, z, x]) - joints[1, :3]  # the inverse of (x, y, z) -> (z, -x, y)
    shown, log = retarget(made, side, joints, "wrist")
    assert log == ""
    poses = world(shown, [bone[1] for bone in made.skeleton.bones])
    np.testing.assert_allclose(poses[made.hand][0], target, atol=1e-3)
    np.testing.assert_allclose(
        shown[:, [0, 1, 2, 7]], rest_of(made)[:, [0, 1, 2, 7]], err_msg="an arm must not stretch"
    )
    wrist = message.hands[side].wrist
    for v in np.eye(3):  # a direction in the wrist frame arrives where the world's axes put it
        got = quat_rotate(quat_multiply(poses[made.hand][1], turn), v * [-1, 1, 1])
        wanted = to_unreal(np.append(quat_rotate(wrist[3:], v), IDENTITY))[:3] / 100.0
        np.testing.assert_allclose(got, wanted, atol=1e-5)


def test_a_hand_that_lacks_bones_moves_the_others_and_the_log_names_them(retarget):
    rng = np.random.default_rng(5)
    message, along = posed("left", rng)
    missing = [manny("left", "pinky", k) for k in range(3)] + [manny("left", "ring", 2), manny("left", "middle", 1)]
    made = character("manny", "left", rng, left_out=missing)
    shown, log = retarget(made, "left", message.hands["left"].joints)
    assert "left hand: no bone for middle intermediate, ring distal, little" in log
    found = finger_rotations(made, shown)
    positions, rotations, _, turn = made.rig
    for i in (3, 4, 9):  # bones whose next bone is there
        bind = positions[i + 1] - positions[i]
        got = quat_rotate(quat_multiply(found[i], quat_conjugate(rotations[i])), bind / np.linalg.norm(bind))
        np.testing.assert_allclose(got, quat_rotate(turn, along[i] * [-1, 1, 1]), atol=0.06)


def test_a_level_of_detail_without_finger_bones_keeps_its_pose(retarget):
    rng = np.random.default_rng(6)
    message, _ = posed("left", rng)
    made = character("manny", "left", rng)
    ends = {made.skeleton.index(name) for name in made.names if not name.startswith("thumb")}
    lod = [i for i in range(len(made.skeleton.bones)) if i not in ends]
    shown, _ = retarget(made, "left", message.hands["left"].joints, lod=lod)
    full, _ = retarget(made, "left", message.hands["left"].joints)
    np.testing.assert_allclose(shown, full[lod], atol=1e-9)


def test_the_weight_blends_and_a_wrong_map_is_logged(retarget):
    rng = np.random.default_rng(7)
    message, _ = posed("right", rng)
    made = character("manny", "right", rng)
    joints = message.hands["right"].joints
    np.testing.assert_allclose(retarget(made, "right", joints, "wrist", weight=0.0)[0], rest_of(made), atol=1e-9)
    shown, log = retarget(made, "right", joints, bone_map='{"RightTail": "x"}')
    assert "RightTail" in log
    assert "allowed" in log
    np.testing.assert_allclose(shown, rest_of(made), atol=1e-9)


@pytest.fixture
def core(harness):
    return harness("gcc-sanitized")


def test_bone_names_are_those_of_the_other_clients(core):
    lines = run(core, "names", text="".join(f"{name}\n" for name in BONE_NAMES))
    for line, (name, meaning) in zip(lines, BONE_NAMES.items(), strict=True):
        if name == "LeftThumbMetacarpal" or meaning is None:
            expected = "Left 0 0" if meaning else "none"
        else:
            side, finger, part = meaning
            expected = f"{side.capitalize()} " + ("hand" if finger is None else f"{finger} {part}")
        assert line == expected, name


def test_full_width_characters_are_those_of_ascii(core):
    names = {"index_02_l": "Left 1 1", "LeftHandIndex3": "Left 1 2", "hand_R": "Right hand", "tail": "none"}
    wide = ["".join(chr(ord(c) + 0xFEE0) for c in name) for name in names]
    assert run(core, "names", text="".join(f"{name}\n" for name in wide)) == list(names.values())


@pytest.mark.parametrize("language", ["gcc-sanitized", "csharp"])
def test_bone_maps(harness, language):
    core = harness(language)
    good = {
        "": "",
        "{}": "",
        '{"LeftHandIndex1": "finger a", "hand_r": "h"}': "LeftHandIndex1=finger a;hand_r=h;",
        json.dumps({"LeftHand": "左手首"}): "LeftHand=左手首;",
        json.dumps({"LeftHand": '\U0001f91a"\\'}): 'LeftHand=\U0001f91a"\\;',
    }
    bad = ["[]", "{", '{"LeftHand"}', '{"LeftHand": 1}', '{"LeftHand": "a",}', '{"LeftHand": "a"} x', '{"Tail": "a"}']
    bad += ['{"LeftHand": "\\ud83e"}', '{"LeftHand": "\\x"}', '{"LeftHand": "a']
    lines = run(core, "bone_maps", text="".join(f"{text}\n" for text in [*good, *bad]))
    assert lines[: len(good)] == list(good.values())
    assert all(line.startswith("error: ") and "allowed" in line for line in lines[len(good) :]), lines


@pytest.mark.parametrize("language", ["gcc-sanitized", "csharp"])
def test_an_arm_reaches_and_keeps_its_lengths(harness, language):
    core, near = harness(language), 1e-6 if language == "gcc-sanitized" else 2e-3  # C# computes with 32 bits
    rng = np.random.default_rng(8)
    arms = [rng.normal(size=(4, 3)) for _ in range(40)]
    arms += [
        np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], target], float) for target in ([1, 1, 0], [-1, 0, 0], [0, 0, 0])
    ]
    lines = run(core, "arms", text="".join(_row(arm.ravel()) + "\n" for arm in arms))
    for line, (shoulder, elbow, wrist, target) in zip(lines, arms, strict=True):
        new_elbow, new_wrist = np.array(line.split(), float).reshape(2, 3)
        upper, lower = np.linalg.norm(elbow - shoulder), np.linalg.norm(wrist - elbow)
        assert np.linalg.norm(new_elbow - shoulder) == pytest.approx(upper, rel=1e-5)
        assert np.linalg.norm(new_wrist - new_elbow) == pytest.approx(lower, rel=1e-5)
        distance = np.linalg.norm(target - shoulder)
        reach = min(max(distance, abs(upper - lower)), upper + lower)
        assert np.linalg.norm(new_wrist - shoulder) == pytest.approx(reach, abs=near)
        if distance > 1e-6:
            off = np.linalg.norm(np.cross(new_wrist - shoulder, target - shoulder)) / distance
            assert off == pytest.approx(0.0, abs=near)
