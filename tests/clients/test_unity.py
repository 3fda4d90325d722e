"""The Unity package has the layout that Unity requires, and its components run on stubs of the engine."""

import json
import os
import re
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
import unity_meta
from checkout import CLIENTS, ROOT, VECTORS, need, publishing
from languages import run
from random_hand import posed
from test_retarget import foreign_rig, shown_directions
from unity_cutter import Reference, compile_signatures, cut, stubbed_types
from unity_facts import FACTS, VERSIONS

from manipnet.geometry import quat_multiply, quat_rotate
from manipnet.outputs.axes import to_unity
from manipnet.wire import encode_binary

PACKAGE = CLIENTS / "unity" / "com.manipnet.client"
CSHARP = ROOT / "tests" / "clients" / "csharp"


def test_every_asset_has_its_meta_file_with_a_stable_guid():
    wanted = unity_meta.files(PACKAGE)
    present = {path for path in PACKAGE.rglob("*.meta")}
    assert present == wanted.keys(), "run clients/unity_meta.py"
    for path, text in wanted.items():
        assert path.read_text(encoding="utf-8") == text, "run clients/unity_meta.py"
    guids = [text.split("guid: ")[1].split("\n")[0] for text in wanted.values()]
    assert len(set(guids)) == len(guids)


def test_assemblies():
    assemblies = {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in PACKAGE.rglob("*.asmdef")}
    assert assemblies["ManipNet.Client.Core"]["noEngineReferences"]
    for name, assembly in assemblies.items():
        assert assembly["name"] == name
        ours = [r for r in assembly["references"] if r.startswith("ManipNet")]
        assert set(ours) <= assemblies.keys()
    samples = json.loads((PACKAGE / "package.json").read_text(encoding="utf-8"))["samples"]
    assert all((PACKAGE / sample["path"]).is_dir() for sample in samples)


@pytest.fixture(scope="module")
def glue(harness):
    return harness("unity")


def test_core_uses_no_engine_type():
    for path in (PACKAGE / "Runtime" / "Core").glob("*.cs"):
        assert "UnityEngine" not in path.read_text(encoding="utf-8"), path.name


@pytest.fixture(scope="module")
def printed(glue):
    """The lines that the components print with a live stream, by their first word."""
    with publishing("--timecode", "01:02:03;04") as (_, tcp, _):
        done = subprocess.run([*glue, tcp], capture_output=True, encoding="utf-8", timeout=120)
    assert done.returncode == 0, done.stderr + done.stdout
    return {"address": tcp, "all": done.stdout} | dict(line.split(" ", 1) for line in done.stdout.splitlines())


@pytest.fixture(scope="module")
def reference():
    """The folder of a clone of Unity's reference source."""
    clone = os.environ.get("MANIPNET_UNITY_REFERENCE")
    if not clone:
        pytest.skip("needs MANIPNET_UNITY_REFERENCE, a clone of github.com/Unity-Technologies/UnityCsReference")
    return clone


@pytest.mark.parametrize("version", VERSIONS)
def test_the_engine_has_what_the_package_uses(reference, version):
    for folders, signature in FACTS:
        command = ["git", "-C", reference, "grep", "-qE", _pattern(signature), version, "--", *folders.split("|")]
        assert subprocess.run(command, check=False).returncode == 0, f"{version} lacks {signature}"


@pytest.mark.parametrize("version", VERSIONS)
def test_the_package_compiles_with_the_signatures_of_the_engine(reference, version, tmp_path):
    (mcs,) = need("mcs")
    sources = [path for path in PACKAGE.rglob("*.cs") if not {"XRHands", "Tests"} & set(path.parts)]
    used = set(re.findall(r"\w+", " ".join(path.read_text(encoding="utf-8") for path in sources)))
    names = stubbed_types([CSHARP / "stubs" / "UnityEngine.cs", CSHARP / "stubs" / "UnityEditor.cs"])
    library = compile_signatures(cut(Reference(reference, version), names, used), tmp_path, mcs)
    options = ["-langversion:7.2", "-warn:4", "-warnaserror", "-nowarn:649", "-r:System.Core", f"-r:{library}"]
    output = ["-target:library", f"-out:{tmp_path / 'package.dll'}"]
    subprocess.run([mcs, *options, *output, *map(str, sources)], check=True)


def _pattern(signature):
    """A pattern that ignores how much space is between the words of a signature."""
    words = re.findall(r"\w+|[^\w\s]", signature)
    spaces = ["[[:space:]]+" if a[-1].isalnum() and b[0].isalnum() else "[[:space:]]*" for a, b in pairwise(words)]
    return "".join(re.escape(word) + space for word, space in zip(words, [*spaces, ""], strict=True))


def numbers(printed, *words):
    return [np.array(printed[word].split(), float) for word in words]


def test_components_pose_a_humanoid_joints_and_a_body(printed):
    lines, tcp = printed, printed["address"]
    assert "no bone for Hand, Thumb, Index, Middle, Ring, Little of the left hand" in printed["all"]
    wrist, hand, joint, body = (np.array(lines[k].split(), float) for k in ("wrist", "hand", "joint", "body"))
    np.testing.assert_allclose(hand[:3], to_unity(wrist)[:3], atol=1e-5)
    np.testing.assert_allclose(
        joint[:3], to_unity(wrist)[:3], atol=1e-5
    )  # all joints of the publisher are at the wrist
    forward = quat_multiply(to_unity(wrist)[3:], np.array([0.0, 1.0, 0.0, 0.0]))
    assert abs(joint[3:] @ forward) == pytest.approx(1.0, abs=1e-5)
    assert body[0] == pytest.approx(-wrist[0], abs=1e-5)
    finger, by_name, xr = (np.array(lines[k].split(), float) for k in ("finger", "byname", "xr"))
    np.testing.assert_allclose(by_name, finger, atol=1e-5)  # the same skeleton with Mixamo's names
    palm = np.array(lines["palm"].split(), float)
    np.testing.assert_allclose([xr, palm], [joint, joint], atol=1e-5)
    assert lines["made"] == "26"  # R_Wrist and R_IndexTip of XR Hands exist already
    assert lines["sample"] == "2 52"
    drawn = [text for key, text in lines.items() if key.startswith("drawn")]
    assert any("tcp://HOST:PORT" in text for text in drawn)
    for start in ("State: connected", "Rate: ", "Age: ", "Lost, late, refused: 0, "):
        assert any(text.startswith(start) for text in drawn), start
    assert lines["setup"] == f"{tcp} True"
    assert lines["state"] == "off"


def test_a_hand_that_lacks_bones_moves_the_others_and_says_which_are_missing(printed):
    assert (
        "warning: ManipNet: no bone for MiddleDistal, Little of the right hand; the other bones move" in printed["all"]
    )
    partial, whole = numbers(printed, "partial", "whole")
    assert 2 * np.degrees(np.arccos(abs(partial[3:] @ whole[3:]))) < 10  # the ring finger stands for the little one


def test_a_bone_map_gives_the_same_pose_as_known_names(printed):
    mapped, whole = numbers(printed, "mapped", "whole")
    np.testing.assert_allclose(mapped, whole, atol=1e-5)
    assert 'the bone map names "Tail"; allowed are names like LeftHand' in printed["all"]


def test_a_humanoid_rests_as_its_avatar_says_not_as_it_stands(printed):
    posed, straight = numbers(printed, "posed", "straight")
    assert abs(posed @ straight) == pytest.approx(1.0, abs=1e-5)


def test_the_arm_brings_the_hand_to_the_wrist_without_stretching(printed):
    (armed,) = numbers(printed, "armed")
    np.testing.assert_allclose(armed[:3], 0.0, atol=1e-5)
    np.testing.assert_allclose(armed[3:], [0.28, 0.01, 0.0], atol=1e-6)
    assert printed["target"] == "True True", "an IK target moves instead of the hand"


def test_props_appear_for_tracked_bodies(printed):
    assert printed["props"] == "1 cube 0.05"


def test_recorder_writes_a_clip_with_timecode(printed):
    assert printed["unsaved"] == "nothing"
    assert printed["recorded"] == "64 4 0.050"  # 16 bones with 4 curves; three steps of a sixtieth
    assert printed["saved"] == "Assets/ManipNet take 01.02.03.04.anim"
    path = "mixamorig:RightHandPinky1/mixamorig:RightHandPinky2/mixamorig:RightHandPinky3"
    assert printed["curve"] == f"{path} m_LocalRotation.w"
    assert printed["event"] == "1 01:02:03;04 DontRequireReceiver"
    assert printed["muscles"] == "40 LeftHand.Thumb.1 Stretched; RightHand.Little.3 Stretched 0.55"


def test_xr_hands_subsystem_gives_both_hands(printed):
    assert printed["subsystem"] == "All True 8 Right"  # index 7 of XR Hands is IndexProximal, whose id is 8
    xrroot, joint = numbers(printed, "xrroot", "joint")
    np.testing.assert_allclose(xrroot[3:], joint[3:], atol=1e-5)  # the same axes as those of ManipNetJoints
    assert printed["stopped"] == "True"


def test_xr_hands_provider_has_an_assembly_of_its_own():
    assembly = json.loads((PACKAGE / "XRHands" / "ManipNet.Client.XRHands.asmdef").read_text(encoding="utf-8"))
    (define,) = assembly["versionDefines"]
    assert (define["name"], define["define"]) == ("com.unity.xr.hands", "MANIPNET_XR_HANDS")
    assert assembly["defineConstraints"] == ["MANIPNET_XR_HANDS"]
    for path in [*(PACKAGE / "Runtime").rglob("*.cs"), *(PACKAGE / "Editor").rglob("*.cs")]:
        assert "XR.Hands" not in path.read_text(encoding="utf-8"), path.name


def test_menu_makes_hands_and_props_and_a_prefab(printed):
    assert printed["menu"] == "3 True True"
    assert printed["prefab"] == "Assets/ManipNet.prefab"


def test_another_actor_in_the_inspector_takes_effect_while_playing(printed):
    assert printed["restart"] == "True True"


def test_setting_a_character_up_twice_adds_one_pair_and_can_be_undone(printed):
    assert printed["twice"] == "2 1 True True True"


def test_one_receiver_shows_several_actors(glue):
    command = [sys.executable, str(ROOT / "tests" / "support" / "actors_publisher.py")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as publisher:
        try:
            assert publisher.stdout is not None
            address = publisher.stdout.readline().split()[1]
            lines = run(glue, address, "actors", "Anna", "Ben")
        finally:
            publisher.kill()
    assert [lines[0], lines[3]] == ["Anna True True", "Ben False True"]
    for wrist, place in (lines[1:3], lines[4:6]):
        assert np.linalg.norm(np.array(place.split()[1:], float)) > 0.1
        np.testing.assert_allclose(np.array(wrist.split()[1:4], float), np.array(place.split()[1:], float), atol=1e-6)


def test_package_names_the_modules_that_it_uses():
    dependencies = json.loads((PACKAGE / "package.json").read_text(encoding="utf-8"))["dependencies"]
    assert dependencies == dict.fromkeys([f"com.unity.modules.{m}" for m in ("animation", "imgui", "physics")], "1.0.0")


@pytest.fixture
def core(harness):
    return harness("csharp")


def test_every_address_of_a_name_is_tried(core):
    with publishing() as (_, tcp, _):
        port = tcp.rpartition(":")[2]
        (line,) = run(core, "connect", "127.0.0.2,::1,127.0.0.1", port)
        assert line == f"127.0.0.1:{port}"
    (line,) = run(core, "connect", "::1,127.0.0.1", "1")
    assert line == "error: no server answers at a name:1"


def test_timecode_of_a_message(core):
    lines = run(core, "timecode", str(VECTORS / "timecode.bin"), str(VECTORS / "live.bin"))
    assert lines == ["23:59:58;29 29.96875", " 0"]


def test_web_socket_client_receives_refuses_and_reconnects(core):
    live = (VECTORS / "live.bin").read_bytes().hex()
    script = [
        "show 0",
        "open",
        "show 0.1",
        f"message {live}",
        "show 0.2",
        "message 00ff",
        "show 0.3",
        "huge",
        "show 0.4",
    ]
    script += ["close", "show 0.5", "show 0.55", "show 0.61", "open", "show 0.7", "show 9", "show 10"]
    shown = [line.split("|") for line in run(core, "websocket", "ws://x:1", text="\n".join(script) + "\n")]
    states = [line[0] for line in shown]
    assert states[:3] == ["connecting", "connected", "connected"]
    assert states[3].startswith("message refused: the message is not pose/bin")
    assert states[4].startswith("message refused: the message has 131073 bytes")
    assert states[5] == states[6] == states[7] == "reconnecting: no server answers at ws://x:1"
    assert states[8] == "connected"
    assert states[9].startswith("reconnecting"), "nothing has arrived for more than five seconds"
    assert [line[1:5] for line in shown] == [
        *(["0", "0", "0", "1"], ["0", "0", "1", "1"], ["1", "0", "1", "1"], ["1", "1", "1", "1"], ["1", "2", "1", "1"]),
        *(["1", "2", "1", "1"], ["1", "2", "1", "1"], ["1", "2", "1", "2"], ["1", "2", "2", "2"], ["1", "2", "2", "2"]),
        ["1", "2", "2", "3"],
    ]
    assert run(core, "websocket", "tcp://127.0.0.1:5555") == [
        'error: the web address is "tcp://127.0.0.1:5555"; a browser allows ws://HOST:PORT, as in ws://127.0.0.1:8081'
    ]


def test_webgl_build_compiles_with_the_browsers_socket(tmp_path):
    (mcs,) = need("mcs")
    sources = [*sorted((PACKAGE / "Runtime").rglob("*.cs")), CSHARP / "stubs" / "UnityEngine.cs"]
    options = ["-langversion:7.2", "-warn:4", "-warnaserror", "-nowarn:649", "-r:System.Core", "-target:library"]
    subprocess.run([mcs, *options, "-define:UNITY_WEBGL", f"-out:{tmp_path}/webgl.dll", *map(str, sources)], check=True)


def test_browser_script_receives_from_the_server(tmp_path):
    (node,) = need("node")
    script = PACKAGE / "Runtime" / "Plugins" / "WebGL" / "ManipNet.jslib"
    declared = set(
        re.findall(r"static extern \w+ (\w+)\(", (PACKAGE / "Runtime" / "BrowserWebSocket.cs").read_text("utf-8"))
    )
    with publishing() as (_, _, websocket):
        command = [node, "--no-warnings", "--experimental-websocket", str(CSHARP / "jslib.mjs"), str(script), websocket]
        done = subprocess.run(command, capture_output=True, encoding="utf-8", timeout=60)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert declared <= set(result["functions"])
    assert result["magic"] == "MNPL"
    assert result["closed"] == 2
    assert result["refused"] == 2


@pytest.mark.parametrize("side", ["left", "right"])
def test_bones_of_a_partial_hand_point_exactly_where_the_hand_does(core, side):
    rng = np.random.default_rng(2)
    message, along = posed(side, rng)
    positions, rotations, tips, turn = foreign_rig(side, rng, mirrored=True)
    rig = [int(side == "right"), *np.hstack([positions, rotations]).ravel(), *tips.ravel()]
    present = [i for i in range(15) if i not in (5, 8, 10, 14)]
    text = f"{' '.join(map(str, rig))}\n{' '.join(map(str, present))}\n{encode_binary(message).hex()}\n"
    (line,) = run(core, "partial", text=text)
    out = np.array(line.split(), float).reshape(15, 4)
    shown = shown_directions(positions, rotations, tips, out)
    exact = [0, 1, 2, 3, 6, 12]  # bones whose next bone, or end, is there
    np.testing.assert_allclose(shown[exact], quat_rotate(turn, along * [-1, 1, 1])[exact], atol=1e-4)
