"""From a rig to a hand profile: the 26 OpenXR joints at rest with straight fingers, and radii from the skin."""

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from manipnet.geometry import SIDES, Side
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.profile import HandProfile, ProfileHand, parse_profile, profile_to_json
from manipnet_tools.hands.bone_map import BoneMap, map_bones, read_map
from manipnet_tools.hands.rig_file import Skeleton, read_skeleton
from manipnet_tools.hands.rig_hand import RigHand, rig_hand

UNITS: Final = {"metres": 1.0, "centimetres": 0.01, "decimetres": 0.1, "millimetres": 0.001, "inches": 0.0254}
"""Units that a file without one may have."""
HUMAN_M: Final = (0.13, 0.24)


@dataclass(frozen=True, eq=False)
class ImportedRig:
    """A rig and the profile of its hands."""

    profile: HandProfile
    skeleton: Skeleton
    unit: float
    """Metres per unit of the file."""
    hands: Mapping[Side, RigHand]
    """The hands that the rig has."""


def import_profile(
    path: Path, name: str, model: Hand, say: Callable[[str], None], map_file: Path | None = None
) -> HandProfile:
    """The hands of an avatar. `say` receives sentences about what was found and guessed.

    Raises `RigFileError`, and `ProfileError` for a hand that cannot be used.
    """
    return import_rig(path, name, model, say, map_file).profile


def import_rig(
    path: Path, name: str, model: Hand, say: Callable[[str], None], map_file: Path | None = None
) -> ImportedRig:
    """The hands of an avatar and where they are in its rig. `say` receives what was found and guessed.

    Raises `RigFileError`, and `ProfileError` for a hand that cannot be used.
    """
    skeleton = read_skeleton(path)
    maps = map_bones(skeleton, str(path)) if map_file is None else read_map(map_file, skeleton)
    unit = 1.0 if skeleton.in_metres else _unit(skeleton, maps, say)
    hands: dict[Side, RigHand] = {}
    for side in SIDES:
        if side not in maps:
            say(f"{side}: the file has no {side} hand; it will be the mirror image of the other")
            continue
        hands[side] = rig_hand(skeleton, maps[side], side, unit, model, str(path), say)
    described: dict[Side, ProfileHand] = {
        side: ProfileHand(hand.joints, hand.radii, hand.t_pose, hand.elbow) for side, hand in hands.items()
    }
    profile = parse_profile(json.loads(profile_to_json(HandProfile(name, described))))
    return ImportedRig(profile, skeleton, unit, hands)


def profile_name(avatar: Path) -> str:
    """The name of an avatar's profile: that of its file without spaces and slashes."""
    return re.sub(r"[\s/]+", "-", avatar.stem)


def _unit(skeleton: Skeleton, maps: dict[Side, BoneMap], say: Callable[[str], None]) -> float:
    """Metres per unit of a file that does not say: the unit with which the hand is of human size."""
    bones = next(iter(maps.values()))
    length = max(float(np.linalg.norm(skeleton.heads[bone] - skeleton.heads[bones[1]])) for bone in bones.values())
    fitting = {what: size for what, size in UNITS.items() if HUMAN_M[0] * 0.7 <= length * size <= HUMAN_M[1]}
    what = next(iter(fitting), "centimetres")
    say(
        f"the file does not give its unit; {what} are assumed, with which the hand is {length * UNITS[what]:.3f} m long"
    )
    return UNITS[what]
