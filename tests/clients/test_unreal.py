"""The Unreal plugin: its descriptor, connection strings and skeleton, and its engine code on stubs of the engine."""

import json
import re
import subprocess

import numpy as np
import pytest
from checkout import CLIENTS, ROOT, VECTORS, need, publishing
from languages import CPP, WARNINGS, run
from make_vectors import messages

from manipnet.outputs.livelink.sender import hand_json

PLUGIN = CLIENTS / "unreal" / "ManipNetLiveLink"
MODULE = PLUGIN / "Source" / "ManipNetLiveLink"
STUBS = ROOT / "tests" / "clients" / "cpp" / "stubs"


@pytest.fixture(scope="module", params=["g++", "clang++"])
def compiler(request, tmp_path_factory):
    """The command of a compiler that finds the stubs in place of every header of the engine."""
    (path,) = need(request.param)
    folder = tmp_path_factory.mktemp("engine")
    folders = (MODULE / "Private", MODULE / "Public")
    own = {path.relative_to(f).as_posix() for f in folders for path in f.rglob("*.h")}
    for source in [*MODULE.glob("P*/*.h"), *MODULE.glob("P*/*.cpp")]:
        for name in re.findall(r'#include "([^"]+)"', source.read_text(encoding="utf-8")):
            if name not in own:
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                (folder / name).write_text('#include "Unreal.h"\n')
    return [
        path,
        "-std=c++17",
        *WARNINGS[:2],
        "-Werror",
        f"-I{STUBS}",
        f"-I{folder}",
        f"-I{MODULE}/Private",
        f"-I{MODULE}/Public",
        f"-I{CPP}",
    ]


def test_one_runtime_module_and_no_library():
    plugin = json.loads((PLUGIN / "ManipNetLiveLink.uplugin").read_text(encoding="utf-8"))
    assert [(m["Name"], m["Type"]) for m in plugin["Modules"]] == [("ManipNetLiveLink", "Runtime")]
    assert {p["Name"] for p in plugin["Plugins"]} == {"LiveLink"}


def test_core_uses_no_engine_type():
    for path in [*CPP.glob("*.h"), *CPP.glob("*.cpp")]:
        for name in re.findall(r'#include "([^"]+)"', path.read_text(encoding="utf-8")):
            assert (CPP / name).exists() or name.startswith("Windows/"), f"{path.name} includes {name}"


def test_glue_compiles(compiler):
    sources = [str(path) for path in MODULE.glob("Private/*.cpp")]
    subprocess.run([*compiler, "-fsyntax-only", *sources], check=True)


def test_source_and_factory_on_stubs(compiler, tmp_path):
    exe = tmp_path / "glue"
    sources = [*MODULE.glob("Private/*.cpp"), *CPP.glob("*.cpp"), ROOT / "tests" / "clients" / "cpp" / "glue.cpp"]
    subprocess.run([*compiler, "-pthread", "-o", str(exe), *map(str, sources)], check=True)
    with publishing() as (_, tcp, _):
        done = subprocess.run([str(exe), f"{tcp} delay=0.05"], capture_output=True, encoding="utf-8", timeout=60)
    assert done.returncode == 0, done.stderr
    lines = dict(line.split(" ", 1) for line in done.stdout.splitlines())
    assert lines["described"] == "3"
    assert lines["bones"] == "26 26 26"
    assert lines["root"] == "wrist -1"
    assert lines["weight"] == "ManipNetWeight 1"
    wrist, body = (np.array(lines[key].split(), float) for key in ("wrist", "body"))
    assert wrist[[0, 2]] == pytest.approx([0, 0], abs=1e-4)
    assert body[1] == pytest.approx(wrist[1], abs=1e-3)  # the cube moves with the hand along our x, which is Unreal's y
    assert 2 * np.arctan2(wrist[3], wrist[6]) == pytest.approx(
        wrist[1] / 100, abs=1e-4
    )  # a turn about our z is one about Unreal's x
    assert lines["machine"] == tcp.removeprefix("tcp://")
    assert "Hz" in lines["status"]
    assert lines["valid"] == "110"
    assert "tcp://HOST:PORT" in lines["wrong"]


@pytest.fixture
def core(harness):
    return harness("gcc-sanitized")


def test_skeleton_equals_that_of_the_json_output(core):
    live = messages()["live"]
    bones = json.loads(hand_json("a", "left", live.hands["left"].joints))["ManipNet_a_left"]
    lines = run(core, "skeleton", text=(VECTORS / "live.bin").read_bytes().hex() + "\n")
    for line, bone in zip(lines, bones, strict=True):
        name, parent, *pose = line.split()
        assert (name, int(parent)) == (bone["Name"], bone["Parent"])
        np.testing.assert_allclose([float(x) for x in pose], bone["Location"] + bone["Rotation"], atol=1e-4)


def test_connection_strings(core):
    meanings = {
        "": "127.0.0.1 5555 '' 0.1",
        "tcp://10.0.0.7:6000": "10.0.0.7 6000 '' 0.1",
        "tcp://[::1]:6000  actor=Anna delay=0.05": "::1 6000 'Anna' 0.05",
    }
    wrong = ["10.0.0.7:6000", "tcp://x", "tcp://x:0", "tcp://x:70000", "tcp://x:5 delay=2", "tcp://x:5 delay="]
    wrong += ["tcp://x:5 y=1"]
    lines = run(core, "connections", text="".join(f"{text}\n" for text in [*meanings, *wrong]))
    assert lines[: len(meanings)] == list(meanings.values())
    assert all(line.startswith("error: ") and "allowed" in line for line in lines[len(meanings) :])
