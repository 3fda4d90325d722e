"""Every language reads the golden vectors to the byte and shows the same: interpolation, axes."""

import json

import numpy as np
import pytest
from checkout import VECTORS
from joint_poses import POSES, assert_joints
from languages import NAMES, run
from manipnet_client import Interpolator, decode
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
    """Printed floats back to the very bits they stand for."""
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


def _script(rng):
    """A rough ride: jitter, losses, a gap, a stall with its backlog, a looping take, a new session."""
    plan = [("s", k, k / 60) for k in range(300) if rng.random() > 0.05 and not 150 <= k < 200]
    plan += [("s", 300 + k, k / 60) for k in range(90)] + [("t", k, 50 + k / 60) for k in range(90)]
    events, start = [], 0.0
    for session, seq, t_capture in plan:
        start = {("s", True): 0.0, ("s", False): 5.2, ("t", True): 6.8}[(session, seq < 300)] - (
            50 if session == "t" else 0
        )
        arrival = start + t_capture + rng.uniform(0, 0.02)
        if session == "s" and 240 <= seq < 270:
            arrival = start + 4.5  # half a second of backlog at once
        payload = encode_binary(message(seq, t_capture, np.sin(3 * t_capture), session))
        events.append((arrival, "push", payload))
    return sorted(events + [(t, "show", b"") for t in np.arange(0.0, 9.0, 1 / 75)], key=lambda e: e[0])


def _row(shown):
    """What a harness prints of a shown frame."""
    if shown is None:
        return "none"
    left, bodies = shown.hands.left, shown.hands.bodies
    values = [*left.wrist[[0, 5, 6]], left.angles[3], left.joints[25, 0], bodies[0].pose[0]]
    return [shown.weight, shown.hands.seq, *values]


def test_interpolates_as_python_does(command):
    events = _script(np.random.default_rng(5))
    text = "delay 0.06\n" + "".join(f"{verb} {float(t)!r} {data.hex()}".strip() + "\n" for t, verb, data in events)
    reference, want = Interpolator(0.06), []
    for t, verb, data in events:
        if verb == "push":
            want.append([float(reference.push(decode(data), t))])
        else:
            want.append(_row(reference.sample(t)))
    lines = run(command, "interpolate", text=text)
    assert len(lines) == len(want)
    for line, values in zip(lines, want, strict=True):
        if values == "none":
            assert line == "none"
        else:
            np.testing.assert_allclose([float(x) for x in line.split()], values, atol=2e-6)


@pytest.mark.parametrize(("name", "engine"), [("csharp", "unity"), ("gcc-sanitized", "unreal"), ("clang", "unreal")])
def test_axes_keep_joint_angles(harness, name, engine):
    poses = [pose[part]["project"] for pose in POSES for part in ("parent", "child")]
    lines = run(harness(name), "axes", text="".join(" ".join(map(str, p)) + "\n" for p in poses))
    converted = {tuple(p): [float(x) for x in line.split()] for p, line in zip(poses, lines, strict=True)}
    assert_joints(engine, lambda pose: converted[tuple(pose.tolist())])
