"""The Unreal plugin: its descriptor, connection strings and skeleton, and its engine code on stubs of the engine."""

import importlib.util
import json
import os
import re
import subprocess
import zipfile
from pathlib import Path

import numpy as np
import pytest
from checkout import CLIENTS, ROOT, VECTORS, need, publishing
from languages import CPP, run
from make_vectors import messages
from unreal_facts import FACTS, RUNTIME
from unreal_headers import MODULE, write_headers

from manipnet.outputs.livelink.sender import hand_json

PLUGIN = CLIENTS / "unreal" / "ManipNetLiveLink"
GLUE = ROOT / "tests" / "clients" / "cpp"

_spec = importlib.util.spec_from_file_location("unreal_package", CLIENTS / "unreal" / "package.py")
assert _spec is not None
assert _spec.loader is not None
unreal_package = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(unreal_package)


@pytest.fixture(scope="module", params=["g++", "clang++"])
def compiler(request, tmp_path_factory):
    """The command of a compiler that finds the stubs in place of every header of the engine."""
    (path,) = need(request.param)
    return [path, *write_headers(tmp_path_factory.mktemp("engine"))]


def test_one_module_for_games_and_live_link_hub_and_no_library():
    plugin = json.loads((PLUGIN / "ManipNetLiveLink.uplugin").read_text(encoding="utf-8"))
    (module,) = plugin["Modules"]
    assert (module["Name"], module["Type"]) == ("ManipNetLiveLink", "RuntimeAndProgram")
    assert plugin["SupportedPrograms"] == module["ProgramAllowList"] == ["LiveLinkHub"]
    assert {p["Name"] for p in plugin["Plugins"]} == {"LiveLink"}


@pytest.mark.parametrize("engine", unreal_package.ENGINES)
def test_zip_names_its_engine(engine, tmp_path):
    with zipfile.ZipFile(unreal_package.write(engine, tmp_path)) as archive:
        plugin = json.loads(archive.read("ManipNetLiveLink/ManipNetLiveLink.uplugin"))
        names = set(archive.namelist())
    assert plugin["EngineVersion"] == f"{engine}.0"
    assert "ManipNetLiveLink/Source/ManipNetLiveLink/Public/ManipNetRetargetAsset.h" in names


def test_stubs_agree_with_the_facts_that_were_read_in_the_engine(compiler):
    subprocess.run([*compiler, "-fsyntax-only", str(GLUE / "facts.cpp")], check=True)


def test_the_engine_has_what_the_plugin_uses():
    source = os.environ.get("MANIPNET_UNREAL_SOURCE")
    if not source:
        pytest.skip("needs MANIPNET_UNREAL_SOURCE, the folder of an engine's source")
    for header, _, signature in FACTS:
        text = (Path(source) / RUNTIME / header).read_text(encoding="utf-8", errors="replace")
        assert _plain(signature) in _plain(text), f"{header} lacks {signature}"


def _plain(code):
    """Code without export macros and without the space that does not part words."""
    words = re.findall(r"\w+|[^\w\s]", re.sub(r"\b\w+_API\b", "", code))
    return " ".join(words)


def test_module_names_the_modules_whose_headers_it_includes():
    rules = (MODULE / "ManipNetLiveLink.Build.cs").read_text(encoding="utf-8")
    for module in ("Core", "CoreUObject", "Engine", "LiveLinkInterface", "LiveLinkAnimationCore", "Slate", "SlateCore"):
        assert f'"{module}"' in rules


def test_core_uses_no_engine_type():
    for path in [*CPP.glob("*.h"), *CPP.glob("*.cpp")]:
        for name in re.findall(r'#include "([^"]+)"', path.read_text(encoding="utf-8")):
            assert (CPP / name).exists() or name.startswith("Windows/"), f"{path.name} includes {name}"


def test_glue_compiles(compiler):
    sources = [str(path) for path in MODULE.glob("Private/*.cpp")]
    subprocess.run([*compiler, "-fsyntax-only", *sources], check=True)


def test_source_and_factory_on_stubs(compiler, tmp_path):
    exe = tmp_path / "glue"
    sources = [*MODULE.glob("Private/*.cpp"), *CPP.glob("*.cpp"), GLUE / "glue.cpp"]
    subprocess.run([*compiler, "-pthread", "-o", str(exe), *map(str, sources)], check=True)
    with publishing("--timecode", "01:02:03;04") as (_, tcp, _):
        done = subprocess.run([str(exe), f"{tcp} delay=0.05"], capture_output=True, encoding="utf-8", timeout=120)
    assert done.returncode == 0, done.stderr
    lines = dict(line.split(" ", 1) for line in done.stdout.splitlines())
    assert lines["bones"] == "26 26 26"
    assert lines["root"] == "wrist -1"
    assert lines["weight"] == "ManipNetWeight 1"
    assert lines["timecode"] == "1 2 3 4 1 30000/1001"
    wrist, body, placed = (np.array(lines[key].split(), float) for key in ("wrist", "body", "placed"))
    assert wrist[[0, 2]] == pytest.approx([0, 0], abs=1e-4)
    assert body[1] == pytest.approx(wrist[1], abs=1e-3)  # both move along our x, which is Unreal's -y
    assert 2 * np.arctan2(wrist[3], wrist[6]) == pytest.approx(
        wrist[1] / 100, abs=1e-4
    )  # a turn about our z is one about Unreal's x, and the left-handed axes turn it back
    assert placed[1:3] == pytest.approx(
        [0, 1000], abs=1e-3
    )  # a quarter turn carries y to -x, and the origin is 10 m up
    assert lines["machine"] == tcp.removeprefix("tcp://")
    assert "Hz" in lines["status"]
    assert lines["settings"] == f"UManipNetLiveLinkSourceSettings {tcp} 0.05"
    assert lines["raw"] == "1 1 0.05"
    assert lines["preset"] == f"{tcp} delay=0.05 mode=raw"
    assert "tcp://HOST:PORT" in lines["refused"]
    assert "tcp://HOST:PORT" in lines["wrong"]


def test_validity_and_removed_subjects_on_stubs(compiler, tmp_path):
    exe = tmp_path / "glue"
    sources = [*MODULE.glob("Private/*.cpp"), *CPP.glob("*.cpp"), GLUE / "glue.cpp"]
    subprocess.run([*compiler, "-pthread", "-o", str(exe), *map(str, sources)], check=True)
    with publishing() as (_, tcp, _):
        done = subprocess.run([str(exe), tcp], capture_output=True, encoding="utf-8", timeout=120)
    lines = done.stdout.splitlines()
    assert "valid at first 0" in lines, "nothing has arrived yet"
    assert "valid 110" in lines, "valid while frames arrive, closed on request, then not valid"
    assert "silent 0" in lines, "nobody answers"
    assert "described 3" in lines
    assert "described again 1 4" in lines, "a subject that a user removed gets its static data again"


@pytest.fixture
def core(harness):
    return harness("gcc-sanitized")


def test_skeleton_equals_that_of_the_json_output(core):
    live = messages()["live"]
    bones = json.loads(hand_json("a_left", live.hands["left"].joints))["ManipNet_a_left"]
    lines = run(core, "skeleton", text=(VECTORS / "live.bin").read_bytes().hex() + "\n")
    for line, bone in zip(lines, bones, strict=True):
        name, parent, *pose = line.split()
        assert (name, int(parent)) == (bone["Name"], bone["Parent"])
        np.testing.assert_allclose([float(x) for x in pose], bone["Location"] + bone["Rotation"], atol=1e-4)


def test_connection_strings(core):
    meanings = {
        "": "127.0.0.1 5555 '' 0.1 | tcp://127.0.0.1:5555",
        "tcp://10.0.0.7:6000": "10.0.0.7 6000 '' 0.1 | tcp://10.0.0.7:6000",
        "tcp://[::1]:6000  actor=Anna delay=0.05": "::1 6000 'Anna' 0.05 | tcp://[::1]:6000 actor=Anna delay=0.05",
        'tcp://x:5 actor="Anna B" mode=raw': "x 5 'Anna B' 0.1 | tcp://x:5 actor=\"Anna B\" mode=raw",
        'tcp://x:5 control=6 avatar=/Game/A.A "bones={%22LeftHand%22: %22a%25b%22}"': (
            "x 5 '' 0.1 | tcp://x:5 control=6 avatar=/Game/A.A bones=\"{%22LeftHand%22: %22a%25b%22}\""
        ),
        "tcp://x:5 yaw=180 origin=1,-2.5,3 scale=2": "x 5 '' 0.1 | tcp://x:5 yaw=180 origin=1,-2.5,3 scale=2",
    }
    wrong = ["10.0.0.7:6000", "tcp://x", "tcp://x:0", "tcp://x:70000", "tcp://x:5 delay=2", "tcp://x:5 delay="]
    wrong += ["tcp://x:5 y=1", "tcp://x:5 mode=fast", "tcp://x:5 yaw=nan", "tcp://x:5 origin=1,2", "tcp://x:5 scale=0"]
    wrong += ["tcp://x:5 origin=1,2,3,4", "tcp://x:5 yaw=1e9", "tcp://x:5 control=0", "tcp://x:5 control=x"]
    lines = run(core, "connections", text="".join(f"{text}\n" for text in [*meanings, *wrong]))
    assert lines[: len(meanings)] == list(meanings.values())
    assert all(line.startswith("error: ") and "allowed" in line for line in lines[len(meanings) :])


def test_timecode_of_a_message_and_its_rate_as_a_fraction(core):
    lines = run(core, "timecode", str(VECTORS / "timecode.bin"), str(VECTORS / "live.bin"))
    assert lines == ["23:59:58;29 29.9688 23 59 58 29 1 30000/1001", " 0 none"]
    rates = {
        "10:00:00:12 25": "10 0 0 12 0 25/1",
        "10:00:00:23 24": "10 0 0 23 0 24/1",
        "10:00:00:23 23.976": "10 0 0 23 0 24000/1001",
        "10:00:00:59 59.94": "10 0 0 59 0 60000/1001",
        "10:00:00;02 30": "10 0 0 2 1 30000/1001",
        "10:00:00:02 0": "none",
        "10:00:00 25": "none",
        "10:00:00:25 25": "none",
        "1a:00:00:25 25": "none",
    }
    assert run(core, "timecodes", text="".join(f"{line}\n" for line in rates)) == list(rates.values())
