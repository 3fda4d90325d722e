"""A hand's skin, bent by its bones."""

import numpy as np

from manipnet.geometry import Array
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics


def skinned(hand: Hand, positions: Array, rotations: Array) -> Array:
    """Linear blend skinning: the vertices `(..., V, 3)` of a hand in the pose of `positions (..., J, 3)` and
    `rotations (..., B, 3, 3)`, in the frame that those are in. A left hand is mirrored as a whole afterwards."""
    bones, in_bones = hand.skin.bones, _vertices_in_bones(hand)
    turned = np.einsum("...vkij,vkj->...vki", rotations[..., bones, :, :], in_bones)
    return np.sum(hand.skin.weights[..., None] * (turned + positions[..., bones, :]), axis=-2)


def _vertices_in_bones(hand: Hand) -> Array:
    """Every vertex in the frame of each bone it follows, `(V, K, 3)`."""
    skin = hand.skin
    positions, rotations = forward_kinematics(hand, skin.bind_angles)
    return np.einsum("vkji,vkj->vki", rotations[skin.bones], skin.vertices[:, None] - positions[skin.bones])
