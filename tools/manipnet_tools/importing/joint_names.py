"""Recognises the joints of hands by the names that gloves and animation programs give them."""

import re
from collections.abc import Iterable
from typing import Final

from manipnet.geometry import Side
from manipnet.wire.rig_names import find_bones
from manipnet_tools.importing.source import FINGERS, PALM, ImportingError

_WORD: Final = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
_SIDES: Final[dict[str, Side]] = {"left": "left", "l": "left", "right": "right", "r": "right"}
_FINGERS: Final = {finger: n for n, finger in enumerate(FINGERS)} | {"pointer": 1, "mid": 2, "pinky": 4, "pinkie": 4}
_PARTS: Final = dict(
    [("metacarpal", "base"), ("carpal", "base"), *((part, part) for part in ("cmc", "mcp", "pip", "dip", "ip"))]
    + [("proximal", "proximal"), ("intermediate", "intermediate"), ("medial", "intermediate"), ("distal", "distal")]
    + [(part, "tip") for part in ("tip", "end", "nub")]
)
_WRISTS: Final = {"wrist", "hand"}
_BODY: Final = {"spine", "chest", "toe", "foot", "arm", "shoulder", "leg", "neck", "head"}
_IN_PALM: Final = {"in", "palm"}

Joint = tuple[Side | None, int]
"""The side of a joint, if its name says so, and its number among the 21."""


def recognised(names: Iterable[str]) -> dict[str, Joint]:
    """The joints among `names` that are those of hands, by name. Two names of one joint are both given."""
    parsed = {name: _parse(name) for name in names}
    thumbs = {(side, part) for found in parsed.values() if found for side, finger, part in [found] if finger == 0}
    joints: dict[str, Joint] = {}
    for name, found in parsed.items():
        if found is None:
            continue
        side, finger, part = found
        if finger is None:
            joints[name] = (side, 0)
        elif (place := _place(finger, part, with_base=(side, "base") in thumbs)) is not None:
            joints[name] = (side, 1 + 4 * finger + place)
    joints = _of_rigs(parsed) | joints
    return {name: joints[name] for name in parsed if name in joints}


def _of_rigs(names: Iterable[str]) -> dict[str, Joint]:
    """The joints whose whole names are those of a known family of rigs."""
    joints: dict[str, Joint] = {}
    for side, bones in find_bones(list(names)).items():
        joints |= {name: (side, 1 + 4 * finger + part) for (finger, part), name in bones.fingers.items()}
        if bones.hand is not None:
            joints[bones.hand] = (side, 0)
    return joints


def require_palm(side: Side, names: dict[int, str], where: str) -> None:
    """Raise `ImportingError` if the wrist or a knuckle is missing from the joints of a hand, `names` by number."""
    if missing := [number for number in PALM if number not in names]:
        what = f"knuckle of the {FINGERS[missing[0] // 4]}" if missing[0] else "wrist"
        known = ", ".join(names[number] for number in sorted(names)) or "none"
        raise ImportingError(f"{where}: the {side} hand has no {what}; the joints that are recognised are {known}")


def _parse(name: str) -> tuple[Side | None, int | None, str] | None:
    """Side, finger (None for the wrist) and part of a name; None if it does not name a joint of a hand."""
    words = [word.lower() for word in _WORD.findall(name.rpartition(":")[2])]
    if _BODY & set(words):
        return None
    side: Side | None = next((_SIDES[word] for word in words if word in _SIDES), None)
    finger = next((_FINGERS[word] for word in words if word in _FINGERS), None)
    if finger is None and "digit" in words and (number := _number(words, "digit")) is not None:
        finger = number - 1
        words.remove(str(number))
    if finger is None:
        last = next((word for word in reversed(words) if word not in _SIDES and not word.isdigit()), None)
        return (side, None, "") if last in _WRISTS else None
    if _IN_PALM & set(words):
        return side, finger, "base" if finger == 0 else "palm"
    part = next((_PARTS[word] for word in words if word in _PARTS), None)
    if part is None:
        part = next((word for word in reversed(words) if word.isdigit()), None)
    return None if part is None else (side, finger, part)


def _number(words: list[str], after: str) -> int | None:
    """The finger's number from 1 to 5 behind a word."""
    at = words.index(after) + 1
    return int(words[at]) if at < len(words) and words[at] in ("1", "2", "3", "4", "5") else None


def _place(finger: int, part: str, with_base: bool) -> int | None:
    """The joint's place in its finger, 0 to 3. A metacarpal of a finger other than the thumb lies in the palm."""
    if part.isdigit():
        return int(part) - 1 if 1 <= int(part) <= 4 else None
    if finger == 0:
        counted = ("base", "proximal", "distal", "tip") if with_base else ("proximal", "intermediate", "distal", "tip")
        named = ("cmc", "mcp", "ip", "tip")
    else:
        counted, named = ("proximal", "intermediate", "distal", "tip"), ("mcp", "pip", "dip", "tip")
    return next((row.index(part) for row in (counted, named) if part in row), None)
