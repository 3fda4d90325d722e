"""Hands of other proportions, made from the free hand."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from manipnet.geometry import Array, quat_exp, quat_multiply, quat_rotate
from manipnet.synthesis.hand.hand import Hand, Indices
from manipnet.synthesis.hand.kinematics import forward_kinematics

HANDS: Final = 24
"""How many hands a set is made with; the first is the free hand itself."""
_SIZES, _FINGERS, _THICKNESSES = (0.88, 1.26), (0.9, 1.1), (0.9, 1.2)
_WRIST_M: Final = 0.015
"""Rigs and trackers put the wrist this far from where anatomy has it."""
_LEANS: Final = (-0.25, 0.05)
"""Radians; fingers at rest lean away from the thumb, some people's more than others'."""


@dataclass(frozen=True)
class Proportions:
    """Relative to the free hand: the size of everything, the length of the fingers, and the thickness.

    `palm_m` is how far the palm with all that belongs to it is moved in the wrist frame, along x and z; `lean` is how
    far the four fingers are turned toward the thumb when their angles are zero, radians.
    """

    size: float = 1.0
    fingers: float = 1.0
    thickness: float = 1.0
    palm_m: tuple[float, float] = (0.0, 0.0)
    lean: float = 0.0


def drawn_proportions(number: int, seed: int) -> Proportions:
    """The proportions of one of the `HANDS`."""
    if number == 0:
        return Proportions()
    rng = np.random.default_rng([seed, 7, number])
    size, fingers, thickness = (round(float(rng.uniform(*limits)), 3) for limits in (_SIZES, _FINGERS, _THICKNESSES))
    along, up = (round(float(rng.uniform(-_WRIST_M, _WRIST_M)), 4) for _ in range(2))
    return Proportions(size, fingers, thickness, (0.5 * along, up), round(float(rng.uniform(*_LEANS)), 3))


def proportioned(hand: Hand, proportions: Proportions, name: str) -> Hand:
    """The hand with other proportions; skin and sensors follow the bones.

    Bones of fingers become longer along themselves, and everything at right angles to a bone becomes thicker.
    """
    long = np.ones(hand.joint_count)
    for finger in hand.fingers:
        long[list(finger[-3:])] = proportions.fingers
    shift = np.array([proportions.palm_m[0], 0.0, proportions.palm_m[1]])
    offsets = proportions.size * long[:, None] * hand.offsets
    offsets[1:][hand.parents[1:] == 0] += shift
    radii = proportions.size * proportions.thickness * hand.radii
    rest, turn = hand.rest_quats.copy(), quat_exp(np.array([0.0, 0.0, proportions.lean]))
    knuckles = [finger[-4] for finger in hand.fingers[1:]]
    rest[knuckles] = quat_multiply(turn, rest[knuckles])
    axes = np.where(np.isin(hand.angle_bones, knuckles)[:, None], quat_rotate(turn, hand.axes), hand.axes)
    changed = replace(hand, name=name, offsets=offsets, radii=radii, rest_quats=rest, axes=axes)
    before, turns = forward_kinematics(hand, hand.skin.bind_angles)
    after, new_turns = forward_kinematics(changed, hand.skin.bind_angles)
    child = np.zeros(hand.bone_count, dtype=int)
    for finger in hand.fingers:
        child[list(finger[:-1])] = finger[1:]
    child[0] = hand.fingers[2][0]
    along = before[child] - before[: hand.bone_count]
    along = np.einsum("bji,bj->bi", turns, along / np.linalg.norm(along, axis=1, keepdims=True))  # in each bone's frame
    stretch = np.array([long[child[bone]] if bone else 1.0 for bone in range(hand.bone_count)])

    def grown(points: Array, bones: Indices) -> Array:
        """Points in the frames of their bones `(..., 3)`."""
        direction = along[bones]
        reach = np.sum(points * direction, axis=-1, keepdims=True)
        aside = points - reach * direction
        thick = np.where(bones == 0, 1.0, proportions.thickness)[..., None]
        moved = np.where(bones == 0, 1.0, 0.0)[..., None] * shift
        return moved + proportions.size * (stretch[bones][..., None] * reach * direction + thick * aside)

    skin, sensors = hand.skin, hand.sensors
    local = np.einsum("vkji,vkj->vki", turns[skin.bones], skin.vertices[:, None] - before[skin.bones])
    placed = after[skin.bones] + np.einsum("vkij,vkj->vki", new_turns[skin.bones], grown(local, skin.bones))
    vertices = np.sum(skin.weights[..., None] * placed, axis=1)
    center = offsets[8] + (sensors.grid_center - hand.offsets[8])
    return replace(
        changed,
        skin=skin._replace(vertices=vertices),
        sensors=sensors._replace(points=grown(sensors.points, sensors.bones), grid_center=center),
    )
