"""The Unity package has the layout that Unity requires, and its components run on stubs of the engine."""

import json
import subprocess

import numpy as np
import pytest
import unity_meta
from checkout import CLIENTS, ROOT, need, publishing

from manipnet.geometry import quat_multiply
from manipnet.outputs.axes import to_unity

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
def glue(tmp_path_factory):
    mcs, mono = need("mcs", "mono")
    exe = tmp_path_factory.mktemp("glue") / "glue.exe"
    sources = [*sorted(PACKAGE.rglob("*.cs")), CSHARP / "Glue.cs", *sorted((CSHARP / "stubs").glob("*.cs"))]
    # 649: Unity assigns fields by itself. 67 and 414: the stubs' attributes and events are not used.
    options = ["-langversion:7.2", "-warn:4", "-warnaserror", "-nowarn:649,67,414", "-r:System.Core", f"-out:{exe}"]
    subprocess.run([mcs, *options, *map(str, sources)], check=True)
    return [mono, str(exe)]


def test_core_uses_no_engine_type():
    for path in (PACKAGE / "Runtime" / "Core").glob("*.cs"):
        assert "UnityEngine" not in path.read_text(encoding="utf-8"), path.name


def test_components_pose_a_humanoid_joints_and_a_body(glue):
    with publishing() as (_, tcp, _):
        done = subprocess.run([*glue, tcp], capture_output=True, encoding="utf-8", timeout=60)
    assert done.returncode == 0, done.stderr + done.stdout
    lines = dict(line.split(" ", 1) for line in done.stdout.splitlines())
    assert "no bone for Hand, ThumbProximal" in lines["error:"]
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
