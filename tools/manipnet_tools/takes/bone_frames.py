"""The same hand with other frames of its bones, for networks that learn from two hands.

A network sees and answers rotations of bones, so hands whose frames are laid differently look different to it although
they move alike. Only mixtures with captured takes need this; a set of generated takes does not.
"""

from dataclasses import replace

import numpy as np

from manipnet.geometry import Array, matrix_to_quat
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics


def in_frames_of(hand: Hand, other: Hand, angles: Array | None = None, other_angles: Array | None = None) -> Hand:
    """The hand with the frames that the bones of another hand of the same layout have.

    Frames are alike when this hand has the pose `angles (A,)` and the other one `other_angles (A,)`, by default zero.
    Hands that rest differently, for example with leaning fingers, are compared in their relaxed poses; where `other` is
    the same hand, both have the same pose. Joints, hinges, skin and sensors stay where they are, and so do the angles
    of every pose. It is the same object if it has these frames already.
    """
    zero = np.zeros(hand.angle_count)
    other_angles = zero if other_angles is None else other_angles
    angles = other_angles if same_joints(hand, other) else zero if angles is None else angles
    own, others = forward_kinematics(hand, angles)[1], forward_kinematics(other, other_angles)[1]
    if np.allclose(own, others, rtol=0.0, atol=1e-9):
        return hand
    turns = np.swapaxes(own, 1, 2) @ others  # from each bone's new frame to its old one
    turns[0] = np.eye(3)
    parents = hand.parents[: hand.bone_count]
    above = np.where(parents < 0, 0, parents)
    rest = hand.skeleton.rest
    quats = matrix_to_quat(np.einsum("bji,bjk,bkl->bil", turns[above], rest, turns))
    sensors = hand.sensors
    return replace(
        hand,
        offsets=_into(turns[np.maximum(hand.parents, 0)], hand.offsets),
        rest_quats=quats,
        axes=_into(turns[above[hand.angle_bones]], hand.axes),
        sensors=sensors._replace(
            points=_into(turns[sensors.bones], sensors.points), normals=_into(turns[sensors.bones], sensors.normals)
        ),
    )


def same_joints(hand: Hand, other: Hand) -> bool:
    """Whether two hands have the same joints, whatever the frames of their bones."""
    flat, others = (forward_kinematics(each, np.zeros(each.angle_count))[0] for each in (hand, other))
    return bool(np.allclose(flat, others, rtol=0.0, atol=1e-6))


def _into(turns: Array, vectors: Array) -> Array:
    return np.einsum("...ji,...j->...i", turns, vectors)
