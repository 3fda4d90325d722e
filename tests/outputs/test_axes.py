"""Joints keep their angle and their meaning in every engine's axes, against poses worked out by hand."""

import pytest
from joint_poses import assert_joints

from manipnet.outputs.axes import to_blender, to_unity, to_unreal

CONVERSIONS = {"unity": to_unity, "unreal": to_unreal, "blender": to_blender, "project": lambda pose: pose}


@pytest.mark.parametrize("engine", CONVERSIONS)
def test_joints_in_the_axes_of(engine):
    assert_joints(engine, CONVERSIONS[engine])
