"""Joint poses that were worked out by hand in the axes of every engine."""

import json

import numpy as np
import pytest
from checkout import VECTORS

from manipnet.geometry import quat_conjugate, quat_log, quat_multiply

POSES = json.loads((VECTORS / "axes.json").read_text(encoding="utf-8"))["poses"]
TOLERANCE_RAD = 1e-4


def assert_joints(engine, convert):
    """Assert that `convert (7,) -> (7,)` gives the poses, joint angles and axes of `axes.json`."""
    for pose in POSES:
        parent, child = (np.asarray(convert(np.array(pose[part]["project"]))) for part in ("parent", "child"))
        for got, part in ((parent, "parent"), (child, "child")):
            np.testing.assert_allclose(got[:3], pose[part][engine][:3], atol=1e-4)
            assert np.abs(got[3:] @ pose[part][engine][3:]) == pytest.approx(1.0, abs=1e-6)
        joint = quat_log(quat_multiply(quat_conjugate(parent[3:]), child[3:]))
        expected = np.radians(pose["joint_degrees"]) * np.array(pose["axis"][engine])
        np.testing.assert_allclose(joint, expected, atol=TOLERANCE_RAD)
