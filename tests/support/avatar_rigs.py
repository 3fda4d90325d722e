"""Rigs of avatars for tests of the clients: other proportions than the model's hand, bent rest poses and odd bone axes.

All poses are in the project's axes (right-handed, Y up, metres) unless a function says otherwise.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import numpy as np

from manipnet.geometry import SIDES, Array, Side, quat_conjugate, quat_exp, quat_multiply, quat_rotate
from manipnet.synthesis.hand.model_profile import model_profile
from manipnet.synthesis.hand.profile import FINGERS
from manipnet.synthesis.model.shipped import shipped_hand
from manipnet_tools.hands.rig_hand import TIP_SHARE

WORDS: Final = ("Thumb", "Index", "Middle", "Ring", "Pinky")
KINDS: Final = ("mixamo", "manny", "metahuman", "cartoon", "vrm1", "motive")
WITHOUT_TIPS: Final = ("manny", "metahuman", "motive")
WITH_METACARPALS: Final = ("metahuman",)


@dataclass
class Rig:
    """The bones of a character in the world at rest; a parent comes before its children."""

    names: list[str] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    positions: list[Array] = field(default_factory=list)
    rotations: list[Array] = field(default_factory=list)

    def add(self, name: str, parent: int, position: Array, rotation: Array) -> int:
        self.names.append(name)
        self.parents.append(parent)
        self.positions.append(position)
        self.rotations.append(rotation)
        return len(self.names) - 1


def avatar_rig(kind: str, seed: int = 0) -> Rig:
    """A character with both hands, whose bones have random axes and whose fingers are bent at rest."""
    rng = np.random.default_rng([KINDS.index(kind), seed])
    rig = Rig()
    root = rig.add("root" if kind != "motive" else "Bob_Hips", -1, np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
    lengths, width = rng.uniform(0.8, 1.25, 5), rng.uniform(0.9, 1.2)
    for side in SIDES:
        _add_hand(rig, root, kind, side, lengths, width, rng)
    return rig


def _add_hand(
    rig: Rig, root: int, kind: str, side: Side, lengths: Array, width: float, rng: np.random.Generator
) -> None:
    turn, at = quat_exp(rng.normal(size=3)), np.array([0.6 if side == "left" else -0.6, 1.3, 0.1])
    axes: Callable[[], Array] = lambda: quat_exp(rng.normal(size=3))  # noqa: E731
    place = lambda p: at + quat_rotate(turn, p)  # noqa: E731
    hand = rig.add(_hand_name(kind, side), root, at, axes())
    joints = model_profile(shipped_hand(), side).joints
    for finger, row in enumerate(FINGERS):
        if kind == "cartoon" and finger in (2, 4):
            continue
        chain = row if finger == 0 else row[1:]
        points = [joints[chain[0], :3] * [width, 1.0, 1.0]]
        bend = quat_exp(joints_axis(joints, chain[0]) * rng.uniform(-0.3, -0.05))
        direction = np.array([0.0, 0.0, 0.0, 1.0])
        for here, after in pairwise(chain):
            points.append(points[-1] + lengths[finger] * quat_rotate(direction, joints[after, :3] - joints[here, :3]))
            direction = quat_multiply(bend, direction)
        parent = hand
        if kind in WITH_METACARPALS and finger:
            name = f"{WORDS[finger].lower()}_metacarpal_{side[0]}"
            parent = rig.add(name, hand, place(0.25 * points[0] + [0.0, 0.004, 0.0]), axes())
        for part, point in enumerate(points):
            if part == 3 and kind in WITHOUT_TIPS:
                continue
            if kind == "cartoon" and part == 2:
                continue
            parent = rig.add(_finger_name(kind, side, finger, part), parent, place(point), axes())


def joints_axis(joints: Array, joint: int) -> Array:
    """The hinge of a finger at a joint: +x of its OpenXR frame."""
    return quat_rotate(joints[joint, 3:], np.array([1.0, 0.0, 0.0]))


def _hand_name(kind: str, side: Side) -> str:
    return {
        "mixamo": f"mixamorig:{side.capitalize()}Hand",
        "manny": f"hand_{side[0]}",
        "metahuman": f"hand_{side[0]}",
        "motive": f"Bob_{side[0].upper()}Hand",
    }.get(kind, f"{side.capitalize()}Hand")


def _finger_name(kind: str, side: Side, finger: int, part: int) -> str:
    word = WORDS[finger]
    if kind in ("manny", "metahuman"):
        return f"{word.lower()}_0{part + 1}_{side[0]}"
    if kind == "mixamo":
        return f"mixamorig:{side.capitalize()}Hand{word}{part + 1}"
    if kind == "motive":
        return f"Bob_{side[0].upper()}{word}{part + 1}"
    parts = ("Metacarpal", "Proximal", "Distal", "Tip") if word == "Thumb" and kind == "vrm1" else None
    parts = parts or ("Proximal", "Intermediate", "Distal", "Tip")
    return f"{side.capitalize()}{word.replace('Pinky', 'Little')}{parts[part]}"


@dataclass(frozen=True)
class Rest:
    """One hand of a rig in the space of its hand bone, in the axes and units of an engine."""

    side: Side
    bones: dict[int, int]
    """Numbers of the rig's bones by finger bone, 0 to 14."""
    positions: dict[int, Array]
    rotations: dict[int, Array]
    tips: dict[int, Array]
    metacarpals: dict[int, Array]

    def line(self) -> str:
        """As the harnesses of the clients read it."""
        words: list[float] = [int(self.side == "right")]
        for bone in range(15):
            there = bone in self.bones
            pose = [*self.positions[bone], *self.rotations[bone]] if there else [0.0] * 7
            words += [int(there), *pose]
        for points in (self.tips, self.metacarpals):
            for finger in range(5):
                words += [int(finger in points), *points.get(finger, np.zeros(3))]
        return " ".join(repr(float(x)) for x in words)

    def end_of(self, bone: int) -> Array:
        """Where a bone ends: at the next one of its finger, at its tip, or where the import guesses that."""
        finger = range(3 * (bone // 3), 3 * (bone // 3) + 3)
        later = [k for k in finger if k > bone and k in self.bones]
        if later:
            return self.positions[later[0]]
        if bone // 3 in self.tips:
            return self.tips[bone // 3]
        before = [k for k in finger if k < bone and k in self.bones][-1]
        return self.positions[bone] + TIP_SHARE * (self.positions[bone] - self.positions[before])

    def pose(self, turned: Array) -> dict[int, Array]:
        """Positions of the bones `0..14` and of the tips `15..19`, with bone rotations `(15, 4)` in the hand's space.

        They are relative to the hand bone, as an engine computes them from bones that only turn.
        """
        out: dict[int, Array] = {}
        for finger in range(5):
            chain = [k for k in range(3 * finger, 3 * finger + 3) if k in self.bones]
            for k in chain:
                out.setdefault(k, self.positions[k])
                end = self.end_of(k)
                after = next((m for m in chain if m > k), 15 + finger)
                local = quat_rotate(quat_conjugate(self.rotations[k]), end - self.positions[k])
                out[after] = out[k] + quat_rotate(turned[k], local)
        return out


def rest_of(rig: Rig, kind: str, side: Side, to_engine: Callable[[Array], Array]) -> Rest:
    """What a client has to find in a rig; `to_engine` turns a pose `(7,)` into the engine's."""
    index = {name: k for k, name in enumerate(rig.names)}
    hand = index[_hand_name(kind, side)]
    engine = [to_engine(np.hstack(pose)) for pose in zip(rig.positions, rig.rotations, strict=True)]
    back = quat_conjugate(engine[hand][3:])

    def place(k: int) -> Array:
        return quat_rotate(back, engine[k][:3] - engine[hand][:3])

    bones = {
        3 * finger + part: index[name]
        for finger in range(5)
        for part in range(3)
        if (name := _finger_name(kind, side, finger, part)) in index
    }
    tips = {f: place(index[n]) for f in range(5) if (n := _finger_name(kind, side, f, 3)) in index}
    palm = {f: f"{WORDS[f].lower()}_metacarpal_{side[0]}" for f in range(1, 5)}
    return Rest(
        side,
        bones,
        {k: place(bone) for k, bone in bones.items()},
        {k: quat_multiply(back, engine[bone][3:]) for k, bone in bones.items()},
        tips,
        {f: place(index[name]) for f, name in palm.items() if name in index},
    )
