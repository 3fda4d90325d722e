"""Hand profiles: the hand of an avatar, as its 26 OpenXR joints at rest with straight fingers.

A profile is a JSON object `{"name": str, "left"|"right": {"joints": [26][7], "radii": [26]}}`. Joints are position (m)
and quaternion (xyzw) in the frame of that hand's OpenXR wrist joint: -z points to the fingers, +y out of the back of
the hand. A joint that the avatar lacks is null. `radii` (m) may be missing, as a whole or one by one. `t_pose` and
`elbow` (m) may say where the bones are in the avatar's T-pose, for receivers that show it from there.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from manipnet.geometry import SIDES, Array, Side, compose, invert, mirror_poses
from manipnet.synthesis.hand.shipped_files import hand_file
from manipnet.wire.hand_names import OPENXR_JOINT_NAMES, OPENXR_PARENTS

MAX_NAME_BYTES: Final = 63
LENGTHS_M: Final = (0.05, 0.6)
"""Shortest and longest hand that is accepted, from the wrist to the farthest fingertip; humans have 0.15 to 0.22."""
RADII_M: Final = (0.0005, 0.08)
SAME_PLACE_M: Final = 1e-4
"""A joint this near its parent has no bone before it, so it counts as missing."""
SAME_LENGTH: Final = 0.02
"""How much the lengths of bones in `t_pose` and `joints` may differ, relative to them."""
_HUGE: Final = 1e12
_REACH_M: Final = 1.5
_HAND_KEYS: Final = ("joints", "radii", "t_pose", "elbow")
_COUNT: Final = len(OPENXR_JOINT_NAMES)
_WRIST: Final = OPENXR_JOINT_NAMES.index("wrist")
_OTHER: Final[dict[Side, Side]] = {"left": "right", "right": "left"}
FINGERS: Final = tuple(
    tuple(k for k, name in enumerate(OPENXR_JOINT_NAMES) if name.startswith(f"{finger}_"))
    for finger in ("thumb", "index", "middle", "ring", "little")
)
"""Numbers of the OpenXR joints of each finger, from its root to its tip; all but the thumb's begin in the palm."""


class ProfileError(ValueError):
    """A hand profile that cannot be used. The text says where, what is wrong and what to do about it."""


@dataclass(frozen=True, eq=False)
class ProfileHand:
    """One hand of a profile, in the frame of its OpenXR wrist joint."""

    joints: Array
    """`(26, 7)` poses at rest; NaN for a joint that the avatar lacks."""
    radii: Array
    """`(26,)` metres; NaN where they are unknown."""
    t_pose: Array | None = None
    """`(26, 3)` where the joints are in the avatar's T-pose, from the wrist, if the avatar faces +z and +y is up; NaN
    where that is unknown. None for a profile that does not describe the T-pose."""
    elbow: Array | None = None
    """`(3,)` the elbow in the T-pose, as `t_pose`; None if it is unknown."""


@dataclass(frozen=True, eq=False)
class HandProfile:
    """The two hands of an avatar. A hand that the profile lacks is the mirror image of the other."""

    name: str
    hands: Mapping[Side, ProfileHand]


def read_profile(path: Path) -> HandProfile:
    """Read a profile from a JSON file, or the shipped one of that name. Raises `ProfileError`, which names the file."""
    path = hand_file(path)
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ProfileError(f"{path}: cannot be read ({error.strerror or error})") from None
    except (ValueError, RecursionError) as error:
        raise ProfileError(f"{path}: is not a JSON file ({error})") from None
    try:
        return parse_profile(content)
    except ProfileError as error:
        raise ProfileError(f"{path}: {error}") from None


def profile_to_json(profile: HandProfile) -> str:
    """The profile as text that `read_profile` reads."""

    def numbers(row: Array) -> Any:
        return None if np.isnan(row).any() else [round(float(x), 7) for x in row]

    hands = {
        side: {
            "joints": [numbers(row) for row in hand.joints],
            "radii": [None if math.isnan(r) else round(float(r), 6) for r in hand.radii],
            **({} if hand.t_pose is None else {"t_pose": [numbers(row) for row in hand.t_pose]}),
            **({} if hand.elbow is None else {"elbow": numbers(hand.elbow)}),
        }
        for side, hand in profile.hands.items()
    }
    return json.dumps({"name": profile.name, **hands})


def parse_profile(content: Any) -> HandProfile:
    """A profile from decoded JSON or msgpack. Raises `ProfileError`."""
    if not isinstance(content, Mapping):
        raise ProfileError(f'a hand profile is a map {{"name", "left", "right"}}, not {_kind(content)}')
    if unknown := [str(key) for key in content if key not in ("name", *SIDES)]:
        raise ProfileError(f"a hand profile has no {unknown[0]!r}; allowed are name, left and right")
    name = _name(content.get("name"))
    hands = {side: _hand(side, content[side]) for side in SIDES if content.get(side) is not None}
    if not hands:
        raise ProfileError(f"{name}: has neither a left nor a right hand; give at least one of them")
    for side in SIDES:
        if side not in hands:
            other = hands[_OTHER[side]]
            hands[side] = _mirror_image(other)
    return HandProfile(name, {side: hands[side] for side in SIDES})


def _mirror_image(hand: ProfileHand) -> ProfileHand:
    flip = np.array([-1.0, 1.0, 1.0])
    t_pose = None if hand.t_pose is None else flip * hand.t_pose
    return ProfileHand(mirror_poses(hand.joints), hand.radii, t_pose, None if hand.elbow is None else flip * hand.elbow)


def _name(name: Any) -> str:
    if not isinstance(name, str) or not name:
        raise ProfileError(f"name must be a text that is not empty, not {_kind(name)}")
    if len(name.encode(errors="replace")) > MAX_NAME_BYTES:
        raise ProfileError(f"name {name[:20]!r}… is longer than {MAX_NAME_BYTES} bytes")
    if not name.isprintable() or any(c in " /" for c in name):
        raise ProfileError(
            f"name {name!r} cannot be part of a topic: it must not contain spaces, slashes or control characters"
        )
    return name


def _hand(side: Side, content: Any) -> ProfileHand:
    if not isinstance(content, Mapping) or "joints" not in content:
        raise ProfileError(f'{side}: must be a map {{"joints", "radii"}}, not {_kind(content)}')
    if unknown := [str(key) for key in content if key not in _HAND_KEYS]:
        raise ProfileError(f"{side}: has no {unknown[0]!r}; allowed are {', '.join(_HAND_KEYS)}")
    joints, radii = _joints(side, content["joints"]), _radii(side, content.get("radii"))
    if np.isnan(joints[_WRIST]).any():
        raise ProfileError(f"{side}: the wrist (joint {_WRIST}) is missing; every other joint is given in its frame")
    joints = compose(invert(joints[_WRIST]), joints)
    joints[_duplicates(joints)] = np.nan
    _check_shape(side, joints)
    return ProfileHand(joints, radii, _t_pose(side, content.get("t_pose"), joints), _elbow(side, content.get("elbow")))


def _t_pose(side: Side, rows: Any, joints: Array) -> Array | None:
    if rows is None:
        return None
    if not isinstance(rows, (list, tuple)) or len(rows) != _COUNT:
        raise ProfileError(f"{side}: t_pose must be a list of {_COUNT} positions in OpenXR order, not {_kind(rows)}")
    places = np.full((_COUNT, 3), np.nan)
    for k, row in enumerate(rows):
        if row is not None:
            places[k] = _position(row, f"{side}: place {k} ({OPENXR_JOINT_NAMES[k]}) of t_pose")
    for finger in FINGERS:
        bones = [k for k in (finger[:-1] if finger is FINGERS[0] else finger[1:-1]) if not np.isnan(joints[k, 0])]
        for k in bones:
            if np.isnan(places[k, 0]):
                raise ProfileError(f"{side}: t_pose lacks joint {k} ({OPENXR_JOINT_NAMES[k]}), which joints has")
        for a, b in pairwise([_WRIST, *bones]):
            theirs = float(np.linalg.norm(places[b] - (0.0 if a == _WRIST else places[a])))
            ours = float(np.linalg.norm(joints[b, :3] - joints[a, :3]))
            if abs(theirs - ours) > SAME_LENGTH * ours:
                raise ProfileError(
                    f"{side}: joint {b} ({OPENXR_JOINT_NAMES[b]}) is {theirs:.4g} m from the one before it in t_pose "
                    f"and {ours:.4g} m in joints; the bones of both must have the same lengths"
                )
    return places


def _elbow(side: Side, value: Any) -> Array | None:
    return None if value is None else _position(value, f"{side}: elbow")


def _position(value: Any, where: str) -> Array:
    """Three numbers within a metre and a half, the reach of an arm. Raises `ProfileError`."""
    if not isinstance(value, (list, tuple)) or len(value) != 3 or not all(map(_is_number, value)):
        raise ProfileError(f"{where} must be 3 numbers x y z, not {_kind(value)}")
    if not all(abs(x) <= _REACH_M for x in value):
        raise ProfileError(f"{where} is {_kind(value)}; positions are in metres from the wrist, at most {_REACH_M:g}")
    return np.array(value, float)


def _joints(side: Side, rows: Any) -> Array:
    if not isinstance(rows, (list, tuple)) or len(rows) != _COUNT:
        raise ProfileError(f"{side}: joints must be a list of {_COUNT} poses in OpenXR order, not {_kind(rows)}")
    joints = np.full((_COUNT, 7), np.nan)
    for k, row in enumerate(rows):
        where = f"{side}: joint {k} ({OPENXR_JOINT_NAMES[k]})"
        if row is None:
            continue
        if not isinstance(row, (list, tuple)) or len(row) != 7 or not all(map(_is_number, row)):
            raise ProfileError(f"{where} must be 7 numbers, x y z and a quaternion x y z w, or null if it is missing")
        joints[k] = [x if abs(x) < _HUGE else np.inf for x in row]
        if not np.isfinite(joints[k]).all():
            raise ProfileError(f"{where} holds a number that is not finite")
        length = float(np.linalg.norm(joints[k, 3:]))
        if abs(length - 1.0) > 1e-2:
            raise ProfileError(f"{where} has a quaternion of length {length:.3g}; it must be 1 (order x y z w)")
        joints[k, 3:] /= length
    return joints


def _radii(side: Side, values: Any) -> Array:
    if values is None:
        return np.full(_COUNT, np.nan)
    if not isinstance(values, (list, tuple)) or len(values) != _COUNT:
        raise ProfileError(f"{side}: radii must be a list of {_COUNT} numbers, not {_kind(values)}")
    radii = np.full(_COUNT, np.nan)
    for k, value in enumerate(values):
        where = f"{side}: radius {k} ({OPENXR_JOINT_NAMES[k]})"
        if value is None:
            continue
        if not _is_number(value):
            raise ProfileError(f"{where} must be a number, or null if it is unknown, not {_kind(value)}")
        if not RADII_M[0] <= value <= RADII_M[1]:
            raise ProfileError(f"{where} is {_kind(value)} m; allowed are {RADII_M[0]:g} to {RADII_M[1]:g} m")
        radii[k] = value
    return radii


def _duplicates(joints: Array) -> NDArray[np.bool_]:
    """Which joints of fingers lie where an earlier joint of the same finger does, `(26,)`."""
    same = np.zeros(_COUNT, np.bool_)
    for finger in FINGERS:
        last = None
        for k in finger:
            if np.isnan(joints[k, 0]):
                continue
            same[k] = last is not None and np.linalg.norm(joints[k, :3] - last) < SAME_PLACE_M
            last = joints[k, :3]
    return same


def _check_shape(side: Side, joints: Array) -> None:
    """Refuse a hand of the wrong size, the other hand, and one that points backward."""
    tips = [finger[-1] for finger in FINGERS[1:] if present_joints(joints, finger)]
    if not tips:
        raise ProfileError(f"{side}: has no finger with at least two joints beyond the palm, apart from the thumb")
    length = float(np.nanmax(np.linalg.norm(joints[:, :3], axis=1)))
    if not LENGTHS_M[0] <= length <= LENGTHS_M[1]:
        raise ProfileError(f"{side}: the hand is {length:.4g} m long; {_size_remedy(length)}")
    roots = np.array([joints[chain[0], :3] for f in FINGERS[1:] if (chain := present_joints(joints, f))])
    forward = -roots.mean(axis=0)[2]
    if forward < 0.3 * float(np.linalg.norm(roots.mean(axis=0))):
        raise ProfileError(
            f"{side}: the fingers do not lie along -z of the wrist; in OpenXR's frame of the wrist -z points to the "
            "fingers and +y out of the back of the hand"
        )
    for where, aside in _thumb_side(joints):
        if aside * (-1.0 if side == "right" else 1.0) < 0.0:
            raise ProfileError(
                f"{side}: {where}, so this is a {_OTHER[side]} hand, or a mirrored one, or +y of the wrist "
                f"points out of the palm; give it as {_OTHER[side]!r}, or undo the mirroring"
            )


def _thumb_side(joints: Array) -> list[tuple[str, float]]:
    """What shows on which side the thumb is, as a clause, and that side: positive for +x."""
    chains = [present_joints(joints, finger) for finger in FINGERS]
    knuckles = [joints[chain[0], :3] for chain in chains[1:] if chain]
    signs = []
    if len(knuckles) > 1:
        signs.append(("its index finger lies where the little finger should be", knuckles[0][0] - knuckles[-1][0]))
    elif chains[0]:
        aside = joints[chains[0][-1], 0] - knuckles[0][0]
        signs.append(("its thumb lies on the wrong side", float(aside)))
    return signs


def _size_remedy(length: float) -> str:
    allowed = f"allowed are {LENGTHS_M[0]:g} to {LENGTHS_M[1]:g} m"
    for factor, what in ((0.01, "centimetres"), (0.001, "millimetres"), (100.0, "metres at scale 0.01")):
        if 0.1 <= length * factor <= 0.3:
            return f"{allowed}; it seems to be in {what}: multiply its positions by {factor:g}"
    return f"{allowed}; positions are in metres"


def present_joints(joints: Array, finger: tuple[int, ...]) -> list[int]:
    """The joints of a finger that a hand has, from the one where the finger leaves the palm; empty for fewer than two.

    The metacarpals of all fingers but the thumb lie in the palm and do not count.
    """
    numbers = finger if finger is FINGERS[0] else finger[1:]
    there = [k for k in numbers if not np.isnan(joints[k, 0])]
    return there if len(there) >= 2 else []


def parent_of(joint: int) -> int:
    """The parent of an OpenXR joint; the wrist for the palm and the metacarpals."""
    return OPENXR_PARENTS[joint]


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _kind(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return f"a list of {len(value)}"
    if isinstance(value, Mapping):
        return f"a map with {', '.join(map(str, list(value)[:5])) or 'nothing'}"
    if isinstance(value, int) and abs(value) > _HUGE:
        return "a huge integer"
    return f"{value!r}"[:40]
