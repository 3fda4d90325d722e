"""Finds the bones of a hand in an armature, by the names that programs give them or by the user's own bone map."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import bpy

from .manipnet_client.retarget import FINGERS, PARTS, is_hand, is_metacarpal, is_thumb_metacarpal, matches

SIDES = ("left", "right")
FINGER_PARTS = tuple(finger + part for finger in FINGERS for part in PARTS)
ALL_PARTS = tuple(side.capitalize() + part for side in SIDES for part in ("Hand", *FINGER_PARTS))
"""The names of all bones in a bone map, as in Unity and VMC: `LeftHand`, `LeftThumbProximal` and so on."""


class RigError(ValueError):
    """An armature or a bone map cannot be used; the text says what is missing."""


@dataclass(frozen=True)
class HandBones:
    """Names of the bones of one hand: thumb to little finger, proximal to distal, with None for a missing bone."""

    hand: str
    fingers: tuple[str | None, ...]
    control: str | None
    """The bone that moves the hand where a rig has such a control, as Rigify's `hand_ik.L`."""
    metacarpals: tuple[str | None, ...]
    """The bones in the palm that lead to the four fingers."""

    @property
    def missing(self) -> list[str]:
        """The parts of the fingers that the armature lacks."""
        return [part for part, name in zip(FINGER_PARTS, self.fingers, strict=True) if name is None]


def find_hand(armature: bpy.types.Object, side: str, bone_map: Mapping[str, str]) -> HandBones:
    """The bones of one hand; entries of `bone_map` come before names. Raises `RigError` if the hand cannot be posed."""
    found = found_parts(armature, side)
    for part, bone in bone_map.items():
        if part not in ALL_PARTS:
            raise RigError(f"the bone map names {part!r}; allowed are {ALL_PARTS[0]}, {ALL_PARTS[1]} … {ALL_PARTS[-1]}")
        if part.lower().startswith(side):
            if bone not in armature.data.bones:
                raise RigError(f"the bone map says {bone!r} for {part}, but {armature.name} has no such bone")
            found[part[len(side) :]] = bone
    hand, fingers = found.get("Hand"), tuple(found.get(part) for part in FINGER_PARTS)
    knuckles = [fingers[3 * finger] for finger in range(1, len(FINGERS))]
    if hand is None or len(knuckles) - knuckles.count(None) < 2:
        missing = [part for part in ("Hand", *FINGER_PARTS) if found.get(part) is None]
        raise RigError(f"{armature.name} has no bone for {', '.join(missing)} of the {side} hand")
    loose = [name for name in fingers if name is not None and armature.data.bones[name].parent is None]
    if loose:
        raise RigError(
            f"{', '.join(loose)} of {armature.name} have no parent, so they cannot follow the hand; parent them"
        )
    return HandBones(hand, fingers, _control(armature, side), _metacarpals(armature, side))


def found_parts(armature: bpy.types.Object, side: str) -> dict[str, str]:
    """The bones that are found by their names, by their parts without the side (`Hand`, `ThumbProximal` …)."""
    names = sorted((bone.name for bone in armature.data.bones), key=_is_driven)
    metacarpal = any(is_thumb_metacarpal(name, side) for name in names)
    found = {"Hand": next((name for name in names if is_hand(name, side)), None)}
    for finger in range(len(FINGERS)):
        for part in range(len(PARTS)):
            wanted = (name for name in names if matches(name, side, finger, part, metacarpal))
            found[FINGERS[finger] + PARTS[part]] = next(wanted, None)
    return {part: name for part, name in found.items() if name is not None}


def read_bone_map(path: Path) -> dict[str, str]:
    """Read a bone map, a JSON object `{"LeftHand": "name of a bone", …}` whose keys are names of any known program.

    Returns it with the names of `ALL_PARTS`. Raises `RigError` and `OSError`.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise RigError(f"{path} is not JSON: {error}") from None
    if not isinstance(content, dict) or not all(isinstance(name, str) for name in content.values()):
        raise RigError(f'{path} must hold one JSON object of the form {{"LeftHand": "name of a bone", …}}')
    if unknown := [name for name in content if _part_of(name) is None]:
        raise RigError(
            f"{path} names {', '.join(unknown)}; allowed are {', '.join(ALL_PARTS)}, and other programs' names"
        )
    return {part: bone for name, bone in content.items() if (part := _part_of(name)) is not None}


def _part_of(name: str) -> str | None:
    """The entry of `ALL_PARTS` that a bone with a known name is."""
    for side in SIDES:
        if is_hand(name, side):
            return f"{side.capitalize()}Hand"
        for finger in range(len(FINGERS)):
            for part in range(len(PARTS)):
                if matches(name, side, finger, part, False):
                    return side.capitalize() + FINGERS[finger] + PARTS[part]
    return None


def write_bone_map(path: Path, bone_map: Mapping[str, str]) -> None:
    """Write a bone map that `read_bone_map` reads. Raises `OSError`."""
    path.write_text(json.dumps(dict(bone_map), indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def _is_driven(bone_name: str) -> tuple[bool, bool]:
    """Rigify's deforming bones follow its controls, and so do those of Auto-Rig Pro, whose controls begin with c_."""
    return bone_name.startswith("DEF-"), not bone_name.startswith("c_")


def _metacarpals(armature: bpy.types.Object, side: str) -> tuple[str | None, ...]:
    names = [bone.name for bone in armature.data.bones]
    fingers = range(1, len(FINGERS))
    return tuple(next((name for name in names if is_metacarpal(name, side, finger)), None) for finger in fingers)


def _control(armature: bpy.types.Object, side: str) -> str | None:
    """The inverse-kinematics control of the hand in the rigs of Rigify, Auto-Rig Pro and Mixamo's add-on."""
    wanted = re.compile(rf"(c?handik{side[0]}|ctrlhandik{side})")
    plain = {bone.name: "".join(filter(str.isalnum, bone.name)).lower() for bone in armature.data.bones}
    return next((name for name, word in plain.items() if wanted.fullmatch(word)), None)
