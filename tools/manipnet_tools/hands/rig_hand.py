"""One hand of a rig: its palm turned as the model's is, its fingers straightened, its radii measured on the skin."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from manipnet.geometry import MIRROR, Array, Side, compose, matrix_to_quat, mirror_poses, quat_to_matrix
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.hinges import openxr_frame
from manipnet.synthesis.hand.model_profile import model_profile
from manipnet.synthesis.hand.openxr import METACARPAL_BASE
from manipnet.synthesis.hand.profile import FINGERS, SAME_PLACE_M
from manipnet_tools.hands.bone_map import BoneMap
from manipnet_tools.hands.rig_file import RigFileError, Skeleton

TIP_SHARE: Final = 0.8
"""The last bone of a finger relative to the one before it, where neither the rig nor the skin shows its end."""
THUMB_BEHIND: Final = 0.08
"""How far the thumb's last joint may be behind the knuckles, relative to the length of the palm."""
PALMAR: Final = 0.6
"""Cosine of the largest angle between the direction of the palm and that in which a radius is measured."""
T_POSE: Final = 0.94, 0.7
"""An avatar is in T-pose if its hand points to the side within 20 degrees, and its palm down within 45 (cosines)."""
RADIUS_SHARES: Final = (0.5, 1.7)
"""How far a radius from the skin may be from the guess by lengths."""


@dataclass(frozen=True, eq=False)
class RigHand:
    """One hand of a rig."""

    bones: BoneMap
    joints: Array
    """`(26, 7)` the OpenXR joints with straight fingers, in the wrist's frame, metres; NaN where one is missing."""
    radii: Array
    """`(26,)` metres; NaN where the skin does not tell."""
    bind: Array
    """`(26, 7)` the same joints as the fingers of the rig are at rest, in the world of the file, metres. A bone of the
    rig turns with its joint from there."""
    t_pose: Array | None
    """`(26, 3)` the joints in the avatar's T-pose, as `ProfileHand.t_pose`."""
    elbow: Array | None
    """`(3,)` the elbow in the T-pose, as `ProfileHand.elbow`."""


def rig_hand(
    skeleton: Skeleton, bones: BoneMap, side: Side, unit: float, model: Hand, where: str, say: Callable[[str], None]
) -> RigHand:
    """The hand of a rig whose bones are known; `unit` is metres per unit of the file. Raises `RigFileError`."""
    return _RigHand(skeleton, bones, side, unit, model, where, say).result()


class _RigHand:
    """One hand of a rig, as a right hand in the OpenXR frame of the wrist."""

    def __init__(
        self,
        skeleton: Skeleton,
        bones: BoneMap,
        side: Side,
        unit: float,
        model: Hand,
        where: str,
        say: Callable[[str], None],
    ) -> None:
        self._skeleton, self._bones, self._side, self._where = skeleton, bones, side, where
        self._say = lambda text: say(f"{side}: {text}")
        self._owners = skeleton.main_owners()
        self._model = model_profile(model, "right")
        flip = np.array([-1.0, 1.0, 1.0]) if side == "left" else np.ones(3)
        self._points = unit * (skeleton.heads - skeleton.heads[bones[1]]) * flip
        self._skin = unit * (skeleton.vertices - skeleton.heads[bones[1]]) * flip
        self._ends = {k: unit * (end - skeleton.heads[bones[1]]) * flip for k, end in skeleton.ends.items()}
        turn = self._palm_frame()
        self._to_wrist, self._flip = turn, flip
        self._tips: dict[int, Array] = {}
        """Where each finger ends, by its last joint."""
        world = MIRROR @ turn @ MIRROR if side == "left" else turn
        self._wrist = np.concatenate([unit * skeleton.heads[bones[1]], matrix_to_quat(world)])
        self._points, self._skin = self._points @ turn, self._skin @ turn
        self._ends = {k: end @ turn for k, end in self._ends.items()}

    def result(self) -> RigHand:
        joints, radii = np.full((26, 7), np.nan), np.full(26, np.nan)
        joints[1] = [0, 0, 0, 0, 0, 0, 1]
        bind = joints.copy()
        named: list[str] = []
        found: list[int] = []
        for row in FINGERS:
            chain = self._chain(row)
            if not chain:
                continue
            named.append(f"{len(chain)} bones of the {_finger(row)}")
            found += chain
            self._add_finger(row, chain, joints, bind, radii)
            if row is not FINGERS[0]:
                base = (
                    self._points[self._bones[row[0]]]
                    if row[0] in self._bones
                    else METACARPAL_BASE * joints[chain[0], :3]
                )
                joints[row[0]] = [*base, 0, 0, 0, 1]
        knuckles = [joints[row[1]] for row in FINGERS[1:] if not np.isnan(joints[row[1], 0])]
        middle = joints[12] if not np.isnan(joints[12, 0]) else np.mean(knuckles, axis=0)
        joints[0] = [*(0.5 * (1.0 + METACARPAL_BASE) * middle[:3]), 0, 0, 0, 1]
        self._say(f"hand bone {self._skeleton.names[self._bones[1]]}; " + ", ".join(named))
        unknown = int(np.isnan(radii[found]).sum())
        if len(self._skin) and unknown:
            self._say(f"the skin does not show the radii of {unknown} bones; they are guessed from their lengths")
        in_palm = [0, *(row[0] for row in FINGERS[1:])]
        bind[in_palm] = joints[in_palm]
        if self._side == "left":
            joints, bind = mirror_poses(joints), mirror_poses(bind)
        return RigHand(self._bones, joints, radii, compose(self._wrist, bind), *self._t_pose())

    def _chain(self, row: tuple[int, ...]) -> list[int]:
        """The joints of a finger, without those that lie where the one before them does."""
        chain: list[int] = []
        for k in (row if row is FINGERS[0] else row[1:])[:-1]:
            if k not in self._bones:
                continue
            here = self._points[self._bones[k]]
            if chain and np.linalg.norm(here - self._points[self._bones[chain[-1]]]) < SAME_PLACE_M:
                name = self._skeleton.names[self._bones[k]]
                self._say(f"the bone {name} lies where the one before it does, so it is left out")
            else:
                chain.append(k)
        return chain

    def _t_pose(self) -> tuple[Array | None, Array | None]:
        """The joints `(26, 3)` and the elbow in the T-pose of an avatar that faces +z; None for another rest pose."""
        places = np.full((26, 3), np.nan)
        bones = {k: bone for row in FINGERS for k in row[:-1] if (bone := self._bones.get(k)) is not None}
        for k, bone in bones.items():
            places[k] = self._points[bone]
        for k, tip in self._tips.items():
            places[k] = tip
        places = places @ self._to_wrist.T * self._flip
        palm = np.nanmean(places, axis=0)
        to_side, up = abs(palm[0]) / np.linalg.norm(palm), self._to_wrist[1, 1]
        if to_side < T_POSE[0] or up < T_POSE[1]:
            return None, None
        forward = np.sign(palm[0]) * (1.0 if self._side == "left" else -1.0)
        turn = np.array([forward, 1.0, forward])
        elbow = self._elbow(float(np.linalg.norm(palm)))
        return turn * places, None if elbow is None else turn * (elbow @ self._to_wrist.T * self._flip)

    def _elbow(self, least: float) -> Array | None:
        """The first bone above the hand that is farther from it than `least`, so not a twist bone."""
        bone = self._skeleton.parents[self._bones[1]]
        while bone >= 0:
            if np.linalg.norm(self._points[bone]) > least:
                return self._points[bone]
            bone = self._skeleton.parents[bone]
        return None

    def _palm_frame(self) -> Array:
        """The rotation to the frame in which the knuckles lie as the model's do (Kabsch's method)."""
        roots = [row[1] for row in FINGERS[1:] if row[1] in self._bones]
        if len(roots) < 2:
            roots += [row[0] for row in FINGERS[:1] if row[0] in self._bones]
        if len(roots) < 2:
            raise RigFileError(
                f"{self._where}: the {self._side} hand has only one finger, so its palm cannot be found; use --map"
            )
        ours = np.array([self._points[self._bones[k]] for k in roots])
        if np.abs(ours).max() < SAME_PLACE_M:
            raise RigFileError(
                f"{self._where}: the knuckles of the {self._side} hand lie where its wrist is, because the bones have "
                "no lengths at rest; export the rig with its rest pose"
            )
        theirs = self._model.joints[roots, :3]
        u, _, v = np.linalg.svd(ours.T @ theirs)
        handed = np.sign(np.linalg.det(u @ v))
        turn = u @ np.diag([1.0, 1.0, handed]) @ v
        scale = np.linalg.norm(theirs) / np.linalg.norm(ours)
        error = np.linalg.norm(scale * ours @ turn - theirs, axis=1).max()
        if error > 0.05:
            raise RigFileError(
                f"{self._where}: the knuckles of the {self._side} hand do not lie side by side as on a hand "
                f"({1000 * error:.0f} mm off); check the names of its bones, or give --map"
            )
        across = [(ours @ turn)[n, 0] for n, k in enumerate(roots) if k != FINGERS[0][0]]
        if any(b <= a for a, b in pairwise(across)):
            raise RigFileError(
                f"{self._where}: the fingers of the {self._side} hand do not lie in the order index, middle, ring, "
                "little finger; check the names of its bones, or give --map"
            )
        return self._palm_up(turn, roots)

    def _palm_up(self, turn: Array, roots: list[int]) -> Array:
        """The thumb decides between a hand and its mirror image, whose knuckles lie alike."""
        thumb = [self._bones[k] for k in FINGERS[0] if k in self._bones]
        if not thumb:
            return turn
        tip = self._points[thumb[-1]] @ turn
        knuckles = np.array([self._points[self._bones[k]] @ turn for k in roots]).mean(axis=0)
        is_outside, is_behind = tip[0] > knuckles[0], tip[1] > knuckles[1] + THUMB_BEHIND * np.linalg.norm(knuckles)
        if is_outside or is_behind:
            raise RigFileError(
                f"{self._where}: the thumb of the {self._side} hand lies on the wrong side: it is the other hand, or "
                "a mirrored one; swap the names of the sides, or apply the negative scale in your program"
            )
        return turn

    def _add_finger(self, row: tuple[int, ...], chain: list[int], joints: Array, bind: Array, radii: Array) -> None:
        points = [self._points[self._bones[k]] for k in chain]
        points.append(self._tip(row, chain, points))
        self._tips[row[-1]] = points[-1]
        lengths = [float(np.linalg.norm(b - a)) for a, b in pairwise(points)]
        along = (points[1] - points[0]) / max(lengths[0], 1e-9)
        bends = [
            np.degrees(np.arccos(np.clip((b - a) @ along / max(n, 1e-9), -1, 1)))
            for (a, b), n in zip(pairwise(points), lengths, strict=True)
        ]
        if max(bends) > 25.0:
            self._say(f"the {_finger(row)} is bent by {max(bends):.0f} degrees at rest; it is straightened")
        frame = openxr_frame(along, self._back(chain[0], along))
        quat, at, direction = matrix_to_quat(frame), points[0], along
        for n, (k, length) in enumerate(zip([*chain, row[-1]], [*lengths, 0.0], strict=True)):
            joints[k] = [*at, *quat]
            at = at + length * along
            if length > 1e-9:
                now = (points[n + 1] - points[n]) / length
                frame, direction = _aimed(frame, direction, now), now
            bind[k] = [*points[n], *matrix_to_quat(frame)]
        for n, k in enumerate(chain):
            palmar = -quat_to_matrix(bind[k, 3:])[:, 1]
            radii[k] = self._radius(self._bones[k], points[n], points[n + 1], palmar, k)
        radii[row[-1]] = radii[chain[-1]]

    def _back(self, joint: int, along: Array) -> Array:
        """The back of a finger: the model's, turned as its bone is."""
        x, y, z, w = self._model.joints[joint, 3:]
        theirs_back = np.array([2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)])
        theirs = -np.array([2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)])
        axis = np.cross(theirs, along)
        return (
            theirs_back
            + np.cross(axis, theirs_back)
            + np.cross(axis, np.cross(axis, theirs_back)) / (1.0 + max(theirs @ along, -0.9))
        )

    def _tip(self, row: tuple[int, ...], chain: list[int], points: list[Array]) -> Array:
        """Where a finger ends: its tip bone, a child or end of its last bone, its skin, or a guess."""
        last = self._bones[chain[-1]]
        if row[-1] in self._bones:
            return self._points[self._bones[row[-1]]]
        if last in self._ends and np.linalg.norm(self._ends[last] - points[-1]) > 1e-3:
            return self._ends[last]
        for child in self._skeleton.children(last):
            if np.linalg.norm(self._points[child] - points[-1]) > 1e-3:
                return self._points[child]
        before = points[-1] - points[-2] if len(points) > 1 else -np.array([0.0, 0.0, 0.03])
        unit = _unit(before)
        own = self._skin[self._owners == last] - points[-1]
        if len(own) > 8:
            at = own @ unit
            away = own - at[:, None] * unit
            facing = away @ -_unit(self._back(chain[0], unit)) > PALMAR * np.linalg.norm(away, axis=1)
            radius = float(np.median(np.linalg.norm(away[facing] if facing.any() else away, axis=1)))
            self._say(f"the {_finger(row)} has no bone at its tip; the end of its skin is taken")
            return points[-1] + max(float(at.max()) - radius, 0.3 * float(np.linalg.norm(before))) * unit
        self._say(f"the end of the {_finger(row)} is guessed from the length of its bone before")
        return points[-1] + TIP_SHARE * before

    def _radius(self, bone: int, start: Array, end: Array, palmar: Array, joint: int) -> float:
        """The distance of the skin from a bone's axis; NaN, for a guess by lengths, where there is little skin.

        It is measured on the palmar side, which touches things, because many rigs have their bones near the back.
        """
        along = end - start
        length = float(np.linalg.norm(along))
        own = self._skin[self._owners == bone] - start
        at = own @ along / max(length, 1e-9) ** 2
        middle = (own - at[:, None] * along)[(at > 0.3) & (at < 0.9)]
        away = np.linalg.norm(middle, axis=1)
        facing = middle @ palmar > PALMAR * away
        if len(middle) < 6 or not facing.any():
            return np.nan
        radius = float(np.median(away[facing]))
        guess = (
            self._model.radii[joint]
            * np.linalg.norm(self._points[self._bones[12 if 12 in self._bones else joint]])
            / 0.107
        )
        return radius if RADIUS_SHARES[0] * guess < radius < RADIUS_SHARES[1] * guess else np.nan


def _unit(vector: Array) -> Array:
    return vector / np.linalg.norm(vector)


def _aimed(frame: Array, before: Array, now: Array) -> Array:
    """A frame `(3, 3)` turned by the shortest way from the unit vector `before` to `now`."""
    x, y, z = np.cross(before, now)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return (np.eye(3) + cross + cross @ cross / max(1.0 + before @ now, 1e-6)) @ frame


def _finger(row: tuple[int, ...]) -> str:
    return ("thumb", "index finger", "middle finger", "ring finger", "little finger")[FINGERS.index(row)]
