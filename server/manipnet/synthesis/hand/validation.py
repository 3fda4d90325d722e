"""What makes a hand usable: a tree of bones, hinges with limits, fingers short enough for the solvers."""

from itertools import pairwise

import numpy as np

from manipnet.synthesis.hand.hand import CHAIN_LENGTH, Hand


class HandError(ValueError):
    """A hand that cannot be used; the text says what is wrong and what is expected."""


def check_hand(hand: Hand) -> None:
    """Raise `HandError` for a hand whose parts do not fit each other or that compiled code has no room for."""
    _check_skeleton(hand)
    _check_fingers(hand)


def _check_skeleton(hand: Hand) -> None:
    joints, bones = hand.joint_count, hand.bone_count
    if len(hand.joint_names) != joints or len(hand.angle_names) != hand.angle_count:
        raise HandError(
            f"it has {len(hand.joint_names)} joint names for {joints} joints and {len(hand.angle_names)} angle names "
            f"for {hand.angle_count} angles"
        )
    if not 0 < bones <= joints:
        raise HandError(f"it has {bones} bones and {joints} joints; bones are the first of the joints")
    above = np.minimum(np.arange(joints), bones)
    if hand.parents[0] != -1 or not ((hand.parents[1:] >= 0) & (hand.parents[1:] < above[1:])).all():
        raise HandError("parents must be -1 for joint 0, the wrist, and an earlier bone for every other joint")
    if (np.diff(hand.angle_bones) < 0).any() or np.bincount(hand.angle_bones, minlength=1).max() > 2:
        raise HandError("angle_bones must rise, and at most two angles may turn one bone")
    if not (hand.limits[:, 0] < hand.limits[:, 1]).all():
        k = int(np.argmin(hand.limits[:, 1] - hand.limits[:, 0]))
        raise HandError(f"limits_rad of {hand.angle_names[k]} are {hand.limits[k].tolist()}; the lower must come first")
    if not (hand.radii > 0.0).all():
        raise HandError("radii_m must be above 0")


def _check_fingers(hand: Hand) -> None:
    for f, finger in enumerate(hand.fingers):
        if not 2 <= len(finger) <= CHAIN_LENGTH + 1 or any(
            hand.parents[joint] != parent for parent, joint in pairwise(finger)
        ):
            raise HandError(
                f"fingers[{f}] is {finger}; a finger is 2 to {CHAIN_LENGTH + 1} joints, each the parent of the next"
            )
    members = [joint for finger in hand.fingers for joint in finger]
    if len(set(members)) != len(members) or not set(hand.angle_bones.tolist()) <= set(members):
        raise HandError("fingers must not share joints, and every bone that an angle turns must belong to one")
    longest = max((int(np.isin(hand.angle_bones, finger).sum()) for finger in hand.fingers), default=0)
    if longest > CHAIN_LENGTH:
        raise HandError(f"a finger has {longest} angles; at most {CHAIN_LENGTH} are allowed")
    capsules = max((int(np.isin(hand.capsules, finger).all(axis=1).sum()) for finger in hand.fingers), default=0)
    if capsules > CHAIN_LENGTH:
        raise HandError(f"a finger has {capsules} capsules; at most {CHAIN_LENGTH} are allowed")
