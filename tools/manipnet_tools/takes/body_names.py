"""Names of a take's bodies: which of them is a wrist."""

from collections.abc import Collection, Iterable
from typing import Final

from manipnet.geometry import SIDES

_WRISTS: Final = {
    f"{side}_wrist": {f"{s}{part}" for s in (side, side[0]) for part in ("wrist", "hand")} for side in SIDES
}


class AmbiguousNameError(ValueError):
    """Several bodies could be one wrist; the text names them."""


def conventional(name: str) -> str:
    """`left_wrist` for LeftWrist, "left hand", L_Hand, Ann:LHand and the like, and so for the right; else the name."""
    letters = "".join(filter(str.isalpha, name.rpartition(":")[2].lower()))
    return next((wrist for wrist, words in _WRISTS.items() if letters in words), name)


def take_names(names: Iterable[str], keep: Collection[str] = ()) -> dict[str, str]:
    """The take's name of each body, by its name in the file; no two are the same.

    A body called `left_wrist` is the left wrist. Otherwise the one rigid body is that is called like it, or else the
    one bone, `Skeleton:Bone`. The bones of several skeletons, and the names in `keep`, stay as they are. Raises
    `AmbiguousNameError` for two rigid bodies.
    """
    result = {name: name for name in names}
    for wrist in _WRISTS:
        alike = [name for name in result if conventional(name) == wrist and name not in keep]
        if wrist in result:
            continue
        bodies = [name for name in alike if ":" not in name]
        if len(bodies) > 1:
            found = " and ".join(map(repr, bodies))
            raise AmbiguousNameError(f"{found} could each be {wrist}; call one of them {wrist}, or rename the others")
        chosen = bodies or alike
        if len(chosen) == 1:
            result[chosen[0]] = wrist
    return result
