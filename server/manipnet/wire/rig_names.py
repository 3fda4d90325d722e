"""How programs name the bones of hands: the one vocabulary, from which the tables of all clients are generated.

Names are compared in their plain form: without a namespace and punctuation, in lower case, with full-width digits as
ordinary ones. A pattern stands for the names of one family of rigs; `PLACES` says what its places in braces may be.
"""

import unicodedata
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Final

from manipnet.geometry import SIDES, Side

FINGERS: Final = ("thumb", "index", "middle", "ring", "little")
PARTS: Final = ("proximal", "intermediate", "distal")
"""The three bones of each finger of a rig. A thumb's first one is its metacarpal, which few rigs call so."""

FINGER_PATTERNS: Final = (
    "deff{finger}0{n}{s}",  # Rigify's deforming bones
    "def{finger}0{n}{s}",
    "{side}{finger}{part}",  # Unity, VRM 0, VRM 1, Godot
    "{finger}{part}{s}",
    "{side}hand{finger}{n}",  # Mixamo, Ready Player Me
    "mixamorig{side}hand{finger}{n}",
    "{finger}0{n}{s}",  # Unreal's mannequins, MetaHuman; a thumb of Rigify
    "f{finger}0{n}{s}",  # Rigify
    "{s}{finger}{n}",  # Daz, Motive
    "jbip{s}{finger}{n}",  # VRoid
    "ccbase{s}{finger}{n}",  # Character Creator
    "{finger}{n}{s}",  # Auto-Rig Pro
    "c{finger}{n}{s}",
    "{side}{finger}{n}",  # SMPL-X
    "{finger}finger{n}{s}",  # VRChat
    "bip01{s}finger{f}{m}",  # 3ds Max Biped
    "bip001{s}finger{f}{m}",
    "finger{g}{n}{s}",  # MakeHuman
    "{j}{jfinger}{jn}",  # MikuMikuDance
    "{jfinger}{jn}{s}",
    "{side}{ordinal}{x}",  # Xsens
)
"""Names of the three bones of each finger; of two that a rig has, the earlier one is taken."""

HAND_PATTERNS: Final = (
    *("defhand{s}", "{side}hand", "mixamorig{side}hand", "{side}wrist", "wrist{s}", "hand{s}", "chandfk{s}"),
    *("{s}hand", "jbip{s}hand", "ccbase{s}hand", "bip01{s}hand", "bip001{s}hand", "{j}手首", "手首{s}"),
)

METACARPAL_PATTERNS: Final = (
    "{side}{finger}metacarpal",
    "{finger}metacarpal{s}",  # Unreal's mannequins, MetaHuman
    "{s}{finger}metacarpal",  # Daz Genesis 9
    "{finger}1base{s}",  # Auto-Rig Pro
    "c{finger}1base{s}",
    "palm0{f}{s}",  # Rigify
    "defpalm0{f}{s}",
    "{s}carpal{f}",  # Daz Genesis 8
    "metacarpal{f}{s}",  # MakeHuman
    "{side}{ordinal}mc",  # Xsens
)
"""Names of the bones in the palm that lead to the four fingers."""

THUMB_METACARPAL_PATTERNS: Final = ("{side}thumbmetacarpal", "thumbmetacarpal{s}", "{s}thumbmetacarpal")
"""In rigs that have one of these (VRM 1, Godot), it is the thumb's first bone, and `proximal` its second."""

_WORDS: Final = (("thumb",), ("index", "fore"), ("middle", "mid"), ("ring", "third"), ("little", "pinky"))
_JAPANESE: Final = (("親指",), ("人指", "人差指"), ("中指",), ("薬指",), ("小指",))
_ORDINALS: Final = ("first", "second", "third", "fourth", "fifth")
_THUMB_XSENS, _FINGER_XSENS = ("mc", "pp", "dp"), ("pp", "mp", "dp")
_SIDE_JAPANESE: Final[Mapping[Side, str]] = {"left": "左", "right": "右"}


@dataclass(frozen=True)
class HandBones:
    """The bones of one hand of a rig, by their names."""

    hand: str | None
    fingers: Mapping[tuple[int, int], str]
    """By finger and part, both counted from zero."""
    metacarpals: Mapping[int, str]
    """By finger, without the thumb's."""


def plain(name: str) -> str:
    """The plain form of a bone's name."""
    return "".join(c for c in unicodedata.normalize("NFKC", name.rpartition(":")[2]) if c.isalnum()).lower()


def finger_names(side: Side, finger: int, part: int) -> tuple[str, ...]:
    """The plain names that one bone of a finger may have."""
    return tuple(dict.fromkeys(_filled(FINGER_PATTERNS, side, finger, part)))


def hand_names(side: Side) -> tuple[str, ...]:
    """The plain names that the bone of the hand may have."""
    return tuple(dict.fromkeys(_filled(HAND_PATTERNS, side, 0, 0)))


def metacarpal_names(side: Side, finger: int) -> tuple[str, ...]:
    """The plain names that the metacarpal of a finger may have; the thumb's is the first bone of VRM 1."""
    patterns = METACARPAL_PATTERNS if finger else THUMB_METACARPAL_PATTERNS
    return tuple(dict.fromkeys(_filled(patterns, side, finger, 0)))


def find_bones(names: Collection[str]) -> dict[Side, HandBones]:
    """The bones of both hands among all bones of a rig.

    The list decides what one name cannot: whether a thumb is counted from its metacarpal or from zero, and which prefix
    all names share.
    """
    by_plain: dict[str, str] = {}
    for prefix in ("", _prefix(names)):
        for name in names:
            by_plain.setdefault(plain(name.removeprefix(prefix)), name)
        found: dict[Side, HandBones] = {side: _hand(by_plain, side) for side in SIDES}
        if any(hand.fingers for hand in found.values()):
            return found
    return {side: HandBones(None, {}, {}) for side in SIDES}


def _hand(by_plain: Mapping[str, str], side: Side) -> HandBones:
    def first(candidates: tuple[str, ...]) -> str | None:
        return next((by_plain[name] for name in candidates if name in by_plain), None)

    fingers = {
        (finger, part): name
        for finger, part in product(range(5), range(3))
        if (name := first(finger_names(side, finger, part))) is not None
    }
    fingers |= _thumb(by_plain, side, fingers)
    metacarpals = {finger: name for finger in range(1, 5) if (name := first(metacarpal_names(side, finger)))}
    return HandBones(first(hand_names(side)), fingers, metacarpals)


def _thumb(
    by_plain: Mapping[str, str], side: Side, fingers: Mapping[tuple[int, int], str]
) -> dict[tuple[int, int], str]:
    """The thumb's bones where the list shows that they are counted from the metacarpal, or from zero."""
    metacarpal = next((by_plain[name] for name in metacarpal_names(side, 0) if name in by_plain), None)
    if metacarpal is not None and (0, 0) in fingers:
        return {(0, 0): metacarpal, (0, 1): fingers[0, 0]}
    from_zero = [f"thumb{n}{side[0]}" for n in range(3)]
    if from_zero[0] in by_plain:
        return {(0, n): by_plain[name] for n, name in enumerate(from_zero) if name in by_plain}
    return {}


def _prefix(names: Collection[str]) -> str:
    """What most names of a rig begin with, up to a punctuation mark, such as the name of the skeleton in Motive."""
    sides = [name for name in names if "hand" in plain(name)] or list(names)
    common = _common_start(min(sides, default=""), max(sides, default=""))
    return common[: max(common.rfind(mark) for mark in "_:-.") + 1]


def _common_start(first: str, last: str) -> str:
    """What two texts begin with; of the smallest and the largest of many, it is what all of them begin with."""
    return first[: next((n for n, (a, b) in enumerate(zip(first, last, strict=False)) if a != b), len(first))]


def _filled(patterns: tuple[str, ...], side: Side, finger: int, part: int) -> Iterator[str]:
    xsens = (_FINGER_XSENS if finger else _THUMB_XSENS)[part]
    for pattern, word, japanese in product(patterns, _WORDS[finger], _JAPANESE[finger]):
        yield pattern.format(
            side=side,
            s=side[0],
            j=_SIDE_JAPANESE[side],
            finger=word,
            jfinger=japanese,
            jn=part + (finger > 0),
            part=PARTS[part],
            n=part + 1,
            m=part or "",
            f=finger,
            g=finger + 1,
            ordinal=_ORDINALS[finger],
            x=xsens,
        )
