"""The model's own hand as a profile, and which of its bones and joints OpenXR's are."""

from itertools import pairwise
from typing import Final

import numpy as np

from manipnet.geometry import Array, Side, compose, invert
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.openxr import pose_in_world
from manipnet.synthesis.hand.profile import FINGERS, ProfileHand
from manipnet.wire.hand_names import OPENXR_JOINT_NAMES

OUR_BONES: Final = (0, 0, 2, 3, 4, 4, *(b for f in range(4) for b in (0, 5 + 3 * f, 6 + 3 * f, 7 + 3 * f, 7 + 3 * f)))
"""`(26,)` the model's bone with which each OpenXR joint turns."""
OUR_JOINTS: Final = (0, 0, 2, 3, 4, 17, *(j for f in range(4) for j in (0, 5 + 3 * f, 6 + 3 * f, 7 + 3 * f, 18 + f)))
"""`(26,)` the model's joint that each OpenXR joint is; 0 for those in the palm."""


def model_profile(model: Hand, side: Side) -> ProfileHand:
    """The model's own hand as a profile."""
    straight = np.zeros((1, model.angle_count))
    _, world = pose_in_world(model, [side], straight, np.array([[0.0, 0, 0, 0, 0, 0, 1]]), 1.0)
    return ProfileHand(compose(invert(world[0, 1]), world[0]), model_radii(model))


def model_radii(model: Hand) -> Array:
    """The radii of the model's capsules at the OpenXR joints where they start, `(26,)`; a tip has its bone's."""
    of_start = {(int(s), int(e)): r for (s, e), r in zip(model.capsules, model.radii, strict=True)}
    radii = np.full(len(OPENXR_JOINT_NAMES), np.nan)
    for row in FINGERS:
        for k, after in pairwise(row):
            start, end = OUR_JOINTS[k], OUR_JOINTS[after]
            radii[k] = of_start[(start, end)]
        radii[row[-1]] = radii[row[-2]]
    palm = radii[[row[0] for row in FINGERS[1:]]]
    radii[:2] = palm.mean()
    return radii
