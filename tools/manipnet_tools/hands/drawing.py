"""Draws the hands of a profile: capsules with joints and hinges, beside the model's hand."""

import numpy as np

from manipnet.geometry import Array, Side
from manipnet.synthesis.hand.avatar import AvatarHand, avatar_hand
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.hand.model_profile import model_profile
from manipnet.synthesis.hand.profile import HandProfile
from manipnet_tools.rendering import (
    SKIN_LEFT,
    SKIN_RIGHT,
    Camera,
    Image,
    PaintedMesh,
    beads,
    contact_sheet,
    render,
    rods,
)

_SIZE = (420, 420)
_VIEWS = ((0.0, 1.45), (0.0, 0.05), (1.45, 0.3))
"""Azimuth and elevation: from above, from the thumb's side, from the fingertips."""
_BENT = 0.5
_GREY = (0.55, 0.57, 0.6)


def draw_profile(profile: HandProfile, model: Hand, rest_angles: Array) -> Image:
    """A sheet of pictures: rows are the hands straight and bent, then the model's hand; columns are three views."""
    images: list[Image] = []
    colors: dict[Side, tuple[float, float, float]] = {"left": SKIN_LEFT, "right": SKIN_RIGHT}
    for side, color in colors.items():
        avatar = avatar_hand(profile.hands[side], side, model)
        for angles in (np.zeros(model.angle_count), rest_angles + _BENT * _bend(model)):
            images += _views(avatar, side, angles, color)
    images += _views(avatar_hand(model_profile(model, "right"), "right", model), "right", 0.0 * rest_angles, _GREY)
    return contact_sheet(images, len(_VIEWS))


def _bend(model: Hand) -> Array:
    return np.array([float(name.endswith("_FE") and "CMC" not in name) for name in model.angle_names])


def _views(avatar: AvatarHand, side: Side, angles: Array, color: tuple[float, float, float]) -> list[Image]:
    positions, rotations = forward_kinematics(avatar.hand, avatar.follow @ angles)
    parts = hand_meshes(avatar.hand, positions, color)
    parts.append(_hinges(avatar.hand, positions, rotations))
    flip = -1.0 if side == "left" else 1.0
    placed = [PaintedMesh(_upright(part.vertices, flip), part.faces[:, :: int(flip)], part.color) for part in parts]
    centre = _upright(positions, flip).mean(axis=0)
    return [render(placed, Camera.orbit(centre, 0.65, *view), _SIZE) for view in _VIEWS]


def hand_meshes(hand: Hand, positions: Array, color: tuple[float, float, float]) -> list[PaintedMesh]:
    """The capsules of a hand with joints `(J, 3)`."""
    parts = []
    for (start, end), radius in zip(hand.capsules.tolist(), hand.radii.tolist(), strict=True):
        first = positions[start] + (0.3 if start == 0 else 0.0) * (positions[end] - positions[start])
        parts.append(rods(first[None], positions[end][None], radius, color))
        parts.append(beads(np.stack([first, positions[end]]), radius, color))
    return parts


def _hinges(hand: Hand, positions: Array, rotations: Array) -> PaintedMesh:
    """The hinge of each angle as a bar through its joint."""
    axes = np.array([rotations[hand.parents[b]] @ a for b, a in zip(hand.angle_bones, hand.axes, strict=True)])
    middle, half = positions[hand.angle_bones], 0.016 * axes
    return rods(middle - half, middle + half, 0.0012, (0.1, 0.25, 0.8))


def _upright(points: Array, flip: float) -> Array:
    """From the wrist frame to one in which the fingers point up the picture and the back of the hand faces up."""
    x, y, z = np.moveaxis(points, -1, 0)
    return np.stack([-flip * y, z, -x], axis=-1)
