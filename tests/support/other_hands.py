"""Hands with fewer fingers and bones than the shipped one, cut out of it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from manipnet.synthesis.hand.hand import Hand


def with_joints(hand: Hand, kept: Sequence[int], name: str = "cut") -> Hand:
    """The hand without the other joints: `kept` are joints from the wrist on, whose parents are kept as well.

    Skin and sensors stay on the bones that remain; what was on others goes to the wrist.
    """
    new = {joint: k for k, joint in enumerate(kept)}
    bones = [joint for joint in kept if joint < hand.bone_count]
    angles = [k for k, bone in enumerate(hand.angle_bones.tolist()) if bone in new]
    capsules = [k for k, ends in enumerate(hand.capsules.tolist()) if set(ends) <= new.keys()]
    moved = np.array([new.get(bone, 0) for bone in range(hand.bone_count)])
    fingers = (tuple(new[joint] for joint in finger if joint in new) for finger in hand.fingers)
    return replace(
        hand,
        name=name,
        joint_names=tuple(hand.joint_names[joint] for joint in kept),
        parents=np.array([new.get(hand.parents[joint], -1) for joint in kept]),
        offsets=hand.offsets[list(kept)],
        rest_quats=hand.rest_quats[bones],
        angle_names=tuple(hand.angle_names[k] for k in angles),
        angle_bones=np.array([new[hand.angle_bones[k]] for k in angles]),
        axes=hand.axes[angles],
        limits=hand.limits[angles],
        fingers=tuple(finger for finger in fingers if finger),
        capsules=np.array([[new[joint] for joint in hand.capsules[k].tolist()] for k in capsules]),
        radii=hand.radii[capsules],
        skin=hand.skin._replace(bones=moved[hand.skin.bones], bind_angles=hand.skin.bind_angles[angles]),
        sensors=hand.sensors._replace(bones=moved[hand.sensors.bones]),
    )


def three_fingered(hand: Hand) -> Hand:
    """Thumb, index and middle finger."""
    return with_joints(hand, [*range(11), 17, 18, 19], "three fingers")
