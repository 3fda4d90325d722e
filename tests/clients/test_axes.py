"""Joints keep their angle and their meaning in every engine's axes, against poses worked out by hand."""

import json

import numpy as np
import pytest
from support import VECTORS

from manipnet.geometry import quat_conjugate, quat_log, quat_multiply
from manipnet.streams.axes import to_blender, to_unity, to_unreal

POSES = json.loads((VECTORS / "axes.json").read_text(encoding="utf-8"))["poses"]
CONVERSIONS = {"unity": to_unity, "unreal": to_unreal, "blender": to_blender, "project": lambda pose: pose}
TOLERANCE_RAD = 1e-4


def assert_joints(engine, convert):
    """`convert (7,) -> (7,)` gives every pose, joint angle and axis as the hand-made vectors say."""
    for pose in POSES:
        parent, child = (np.asarray(convert(np.array(pose[part]["project"]))) for part in ("parent", "child"))
        for got, part in ((parent, "parent"), (child, "child")):
            np.testing.assert_allclose(got[:3], pose[part][engine][:3], atol=1e-4)
            assert np.abs(got[3:] @ pose[part][engine][3:]) == pytest.approx(1.0, abs=1e-6)
        joint = quat_log(quat_multiply(quat_conjugate(parent[3:]), child[3:]))
        expected = np.radians(pose["joint_degrees"]) * np.array(pose["axis"][engine])
        np.testing.assert_allclose(joint, expected, atol=TOLERANCE_RAD)


@pytest.mark.parametrize("engine", CONVERSIONS)
def test_joints_in_the_axes_of(engine):
    assert_joints(engine, CONVERSIONS[engine])
