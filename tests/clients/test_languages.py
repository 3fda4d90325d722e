"""The clients of all languages read the golden vectors exactly, interpolate alike, and convert axes correctly."""

import json

import numpy as np
import pytest
from checkout import VECTORS
from joint_poses import POSES, assert_joints
from languages import NAMES, run
from publisher import message

from manipnet.wire import encode_binary

EXPECTED = json.loads((VECTORS / "expected.json").read_text(encoding="utf-8"))
BROKEN = sorted(VECTORS.glob("bad_*.bin"))


@pytest.fixture(scope="module", params=NAMES)
def command(request, harness):
    return harness(request.param)


def test_reads_the_golden_vectors(command):
    lines = run(command, "decode", *(str(VECTORS / f"{name}.bin") for name in EXPECTED))
    for name, line in zip(EXPECTED, lines, strict=True):
        assert _as_f32(json.loads(line)) == EXPECTED[name], name


def _as_f32(value):
    """The 32-bit numbers that the printed ones stand for."""
    if isinstance(value, dict):
        exact = ("t_capture", "t_publish", "look_ahead", "seq")
        return {k: v if k in exact else _as_f32(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_as_f32(v) for v in value]
    return float(np.float32(value)) if isinstance(value, float | int) and not isinstance(value, bool) else value


def test_refuses_broken_vectors_and_names_both_versions(command):
    lines = run(command, "decode", *map(str, BROKEN))
    errors = {path.stem: json.loads(line)["error"] for path, line in zip(BROKEN, lines, strict=True)}
    assert "version 2" in errors["bad_version_2"]
    assert "version 1" in errors["bad_version_2"]


@pytest.fixture(scope="module")
def script():
    """Input of the harnesses: jitter, losses, a gap, a stall with its backlog, a looping take, a new session."""
    rng = np.random.default_rng(5)
    plan = [("s", k, k / 60) for k in range(300) if rng.random() > 0.05 and not 150 <= k < 200]
    plan += [("s", 300 + k, k / 60) for k in range(90)] + [("t", k, 50 + k / 60) for k in range(90)]
    events = []
    for session, seq, t_capture in plan:
        start = -43.2 if session == "t" else 5.2 if seq >= 300 else 0.0
        arrival = start + t_capture + rng.uniform(0, 0.02)
        if session == "s" and 240 <= seq < 270:
            arrival = 4.5  # half a second of backlog at once
        payload = encode_binary(message(seq, t_capture, np.sin(3 * t_capture), session))
        events.append((arrival, f"push {arrival!r} {payload.hex()}"))
    events += [(t, f"show {t!r}") for t in np.arange(0.0, 9.0, 1 / 75).tolist()]
    events.sort(key=lambda event: event[0])
    return "\n".join(["delay 0.06", *(line for _, line in events)]) + "\n"


@pytest.fixture(scope="module")
def reference(harness, script):
    """What the Python client prints for the script."""
    return run(harness("python"), "interpolate", text=script)


def test_interpolates_as_python_does(command, script, reference):
    lines = run(command, "interpolate", text=script)
    assert len(lines) == len(reference) > 900
    for line, wanted in zip(lines, reference, strict=True):
        if wanted == "none":
            assert line == "none"
        else:
            values, numbers = ([float(word) for word in text.split()] for text in (line, wanted))
            np.testing.assert_allclose(values, numbers, atol=2e-6)


@pytest.mark.parametrize(("name", "engine"), [("csharp", "unity"), ("gcc-sanitized", "unreal"), ("clang", "unreal")])
def test_axes_keep_joint_angles(harness, name, engine):
    poses = [pose[part]["project"] for pose in POSES for part in ("parent", "child")]
    lines = run(harness(name), "axes", text="".join(" ".join(map(str, p)) + "\n" for p in poses))
    converted = {tuple(p): [float(x) for x in line.split()] for p, line in zip(poses, lines, strict=True)}
    assert_joints(engine, lambda pose: converted[tuple(pose.tolist())])
