"""Which bone of a rig is which OpenXR joint: by the vocabulary of names, or by a map that a user writes."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Final

from manipnet.geometry import SIDES, Side
from manipnet.synthesis.hand.profile import FINGERS
from manipnet.wire.hand_names import OPENXR_JOINT_NAMES, WEBXR_JOINT_NAMES
from manipnet.wire.rig_names import PARTS, find_bones, finger_names, hand_names, metacarpal_names, plain
from manipnet_tools.hands.rig_file import RigFileError, Skeleton

JOINTS: Final = {name: k for k, name in enumerate(OPENXR_JOINT_NAMES)}
BoneMap = dict[int, int]
"""The bone of each OpenXR joint that a rig has, by number."""


def map_bones(skeleton: Skeleton, where: str) -> dict[Side, BoneMap]:
    """The hands of a rig, by the names of its bones. Raises `RigFileError` if there is none."""
    number = {name: k for k, name in reversed(list(enumerate(skeleton.names)))}
    webxr = {
        JOINTS[OPENXR_JOINT_NAMES[k + 1]]: number[name] for k, name in enumerate(WEBXR_JOINT_NAMES) if name in number
    }
    if len(webxr) > 5:
        return {_side_of(where): webxr}
    hands: dict[Side, BoneMap] = {}
    for side, bones in find_bones(skeleton.names).items():
        if not any(finger for finger, _ in bones.fingers):
            continue
        found = {FINGERS[f][part + (f > 0)]: number[name] for (f, part), name in bones.fingers.items()}
        found |= {FINGERS[f][0]: number[name] for f, name in bones.metacarpals.items()}
        used = [*bones.fingers.values(), *bones.metacarpals.values(), *([bones.hand] if bones.hand else [])]
        _check_distinct(skeleton, used, where)
        hand = number.get(bones.hand or "")
        hands[side] = found | {1: _common_parent(skeleton, found) if hand is None else hand}
    if not skeleton.names:
        raise RigFileError(f"{where}: holds no bones; export the skeleton of the avatar with its mesh")
    if not hands:
        raise RigFileError(
            f"{where}: no finger bones are recognised among {', '.join(skeleton.names[:12])}"
            f"{' …' * (len(skeleton.names) > 12)}; rename them, or say which is which with --map"
        )
    return hands


def _check_distinct(skeleton: Skeleton, names: Iterable[str], where: str) -> None:
    """Raise `RigFileError` if one of the names is that of several bones."""
    if shared := next((name for name in names if plain(name) in skeleton.ambiguous), None):
        raise RigFileError(
            f"{where}: several bones are called {shared!r}, as in a file of several characters; export one of them "
            "into a file of its own, or rename the bones of the others"
        )


def read_map(path: Path, skeleton: Skeleton) -> dict[Side, BoneMap]:
    """A map from a JSON file. Raises `RigFileError`.

    It is the bone map of the clients, `{"LeftHandIndex1": name of a bone, …}`. Its keys are names of any program that
    is known, and it adds to the bones that are found by their own names. For rigs with other joints, it is
    `{"left"|"right": {OpenXR joint: name of a bone}}`.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise RigFileError(f"{path}: is not a JSON file ({error})") from None
    if isinstance(content, Mapping) and content and all(isinstance(bone, str) for bone in content.values()):
        return _read_names(path, content, skeleton)
    if not isinstance(content, Mapping) or not content or not all(side in SIDES for side in content):
        raise RigFileError(
            f'{path}: must be {{"LeftHand": bone, "LeftHandIndex1": bone, …}} with the names of any known program, or '
            '{"left": {joint: bone}, "right": {joint: bone}} with those of OpenXR'
        )
    hands: dict[Side, BoneMap] = {}
    for side in SIDES:
        if side in content:
            if not isinstance(content[side], Mapping):
                raise RigFileError(f"{path}: {side} must be {{joint: name of a bone}}, not {str(content[side])[:40]!r}")
            hands[side] = {_joint(path, name): _bone(path, bone, skeleton) for name, bone in content[side].items()}
            if JOINTS["wrist"] not in hands[side]:
                raise RigFileError(f"{path}: {side} has no wrist; give the bone of the hand as wrist")
    _check_used_once(path, hands, skeleton)
    return hands


def _check_used_once(path: Path, hands: Mapping[Side, BoneMap], skeleton: Skeleton) -> None:
    seen: dict[int, str] = {}
    for side, bones in hands.items():
        for joint, bone in bones.items():
            here = f"{side} {OPENXR_JOINT_NAMES[joint]}"
            if bone in seen:
                name = skeleton.names[bone]
                raise RigFileError(f"{path}: the bone {name!r} is given for {seen[bone]} and for {here}; it can be one")
            seen[bone] = here


def _read_names(path: Path, content: Mapping[str, str], skeleton: Skeleton) -> dict[Side, BoneMap]:
    """The hands of a rig in which the named bones have the names that the map gives them."""
    given: dict[int, str] = {}
    for known, bone in content.items():
        if plain(known) not in _known_names():
            raise RigFileError(f"{path}: {known!r} is not a name that a known program gives to a bone of a hand")
        given[_bone(path, bone, skeleton)] = known
    taken = {plain(known) for known in given.values()}
    names = [given.get(k, f"{n} (not mapped)" if plain(n) in taken else n) for k, n in enumerate(skeleton.names)]
    return map_bones(replace(skeleton, names=names, ambiguous=skeleton.ambiguous - taken), str(path))


@cache
def _known_names() -> frozenset[str]:
    fingers, parts = range(len(FINGERS)), range(len(PARTS))
    names = [hand_names(side) for side in SIDES] + [
        metacarpal_names(side, finger) for side in SIDES for finger in fingers
    ]
    names += [finger_names(side, finger, part) for side in SIDES for finger in fingers for part in parts]
    return frozenset(name for each in names for name in each)


def _joint(path: Path, name: str) -> int:
    if name not in JOINTS:
        raise RigFileError(f"{path}: there is no joint {name!r}; the joints are {', '.join(JOINTS)}")
    return JOINTS[name]


def _bone(path: Path, bone: object, skeleton: Skeleton) -> int:
    if bone not in skeleton.names:
        raise RigFileError(f"{path}: the rig has no bone {bone!r}; its bones are {', '.join(skeleton.names)}")
    if skeleton.names.count(str(bone)) > 1:
        raise RigFileError(f"{path}: the rig has several bones {bone!r}; rename them in the file of the avatar")
    return skeleton.names.index(str(bone))


def _side_of(where: str) -> Side:
    """The side of a file that holds one hand, by its name."""
    name = Path(where).stem.lower()
    side: Side | None = "left" if "left" in name else "right" if "right" in name else None
    if side is None:
        raise RigFileError(f"{where}: holds one hand, but its name does not say which; name it left.glb or right.glb")
    return side


def _common_parent(skeleton: Skeleton, found: BoneMap) -> int:
    """The deepest bone that all fingers hang on, for a rig whose hand has an unknown name."""
    chains = []
    for bone in found.values():
        chain = [bone]
        while skeleton.parents[chain[-1]] >= 0:
            chain.append(skeleton.parents[chain[-1]])
        chains.append(chain)
    return next(bone for bone in chains[0][1:] if all(bone in chain for chain in chains))
