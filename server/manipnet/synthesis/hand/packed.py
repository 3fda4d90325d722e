"""A hand inside compiled code: from the one array that kernels are given to the named tuples they work with."""

import numpy as np

from manipnet.jit import inner
from manipnet.synthesis.hand.hand import Chains, Sensors, Skeleton


@inner
def unpack_skeleton(packed: np.ndarray):
    """The skeleton of a packed hand `(1,)`."""
    hand = packed[0]
    joints, bones, angles = hand["joints"], hand["bones"], hand["angles"]
    return Skeleton(
        hand["parents"][:joints],
        hand["offsets"][:joints],
        hand["rest"][:bones],
        hand["angle_bones"][:angles],
        hand["axes"][:angles],
        hand["first_angle"][:bones],
        hand["angle_counts"][:bones],
    )


@inner
def unpack_chains(packed: np.ndarray):
    """The fingers of a packed hand `(1,)`."""
    hand = packed[0]
    fingers, capsules = hand["fingers"], hand["capsules"]
    return Chains(
        hand["chain_angles"][:fingers],
        hand["chain_joints"][:fingers],
        hand["chain_capsules"][:fingers],
        hand["capsule_starts"][:capsules],
        hand["capsule_ends"][:capsules],
        hand["capsule_radii"][:capsules],
    )


@inner
def unpack_sensors(packed: np.ndarray):
    """The sensors of a packed hand `(1,)`."""
    hand = packed[0]
    sensors = hand["sensors"]
    return Sensors(
        hand["sensor_bones"][:sensors],
        hand["sensor_weights"][:sensors],
        hand["sensor_points"][:sensors],
        hand["sensor_normals"][:sensors],
        hand["grid_center"],
    )
