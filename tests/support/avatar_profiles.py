"""Hand profiles for tests: the model's hand with other proportions, and with joints taken away."""

import numpy as np

from manipnet.geometry import SIDES
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.model_profile import model_profile
from manipnet.synthesis.hand.profile import FINGERS, HandProfile, ProfileHand


def scaled_profile(model: Hand, fingers: float = 1.0, whole: float = 1.0, name: str = "test") -> HandProfile:
    """The model's hand with `fingers` times as long fingers, then `whole` times as large."""
    hands = {}
    for side in SIDES:
        own = model_profile(model, side)
        joints = own.joints.copy()
        for row in FINGERS:
            chain = row if row is FINGERS[0] else row[1:]
            root = own.joints[chain[0], :3]
            for k in chain:
                joints[k, :3] = root + fingers * (own.joints[k, :3] - root)
        joints[:, :3] *= whole
        hands[side] = ProfileHand(joints, own.radii * whole)
    return HandProfile(name, hands)


def as_content(profile: HandProfile) -> dict:
    """The profile as decoded JSON."""
    content: dict = {"name": profile.name}
    for side, hand in profile.hands.items():
        rows = [None if np.isnan(row).any() else row.tolist() for row in hand.joints]
        content[side] = {"joints": rows, "radii": hand.radii.tolist()}
    return content
