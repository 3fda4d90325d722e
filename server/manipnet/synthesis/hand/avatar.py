"""An avatar's hand as the kernels know hands: a `Hand` made from a `ProfileHand`, beside the model's.

Every finger is a chain of at most four hinges: two at its root (the thumb's carpal joint, a finger's knuckle) and one
at each further joint. At the root they are the model's, which anatomy gives; the others are perpendicular to the bones
and come from the geometry of the profile. Angles mean what the model's mean: at zero, every finger is straight and
points where the model's does, so the model's angles are the first guess and its limits are the avatar's.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np

from manipnet.geometry import (
    Array,
    Side,
    matrix_to_quat,
    mirror_poses,
    quat_multiply,
    quat_rotate,
    quat_to_matrix,
)
from manipnet.synthesis.hand.hand import Hand, Indices, Sensors, Skin
from manipnet.synthesis.hand.hinges import aim_hinges, bend_between, openxr_frame, turn_matrix, unit
from manipnet.synthesis.hand.kinematics import forward_kinematics
from manipnet.synthesis.hand.model_profile import OUR_BONES, OUR_JOINTS, model_radii
from manipnet.synthesis.hand.places import OpenXrPlaces
from manipnet.synthesis.hand.profile import FINGERS, ProfileHand, present_joints
from manipnet.wire.hand_names import OPENXR_JOINT_NAMES

EXTRA_LIMIT_RAD: Final = np.radians(10.0)
"""Fingers of other lengths need a little more than the captured range."""
_Q_WRIST_OPENXR: Final = np.array([0.5, -0.5, -0.5, 0.5])
"""The OpenXR frame of a right wrist in the frame of `hand`."""
_ROOT_ANGLES: Final = ((0, 1), (4, 5), (8, 9), (12, 13), (16, 17))
"""The model's two angles at the root of each finger."""


@dataclass(frozen=True, eq=False)
class AvatarHand:
    """One hand of an avatar in canonical form: as a right hand in the frame of `hand`."""

    hand: Hand
    places: OpenXrPlaces
    follow: Array
    """`(A, A_model)` the avatar's angles that turn its bones as the model's angles turn the model's."""
    radii: Array
    """`(26,)` radius at each OpenXR joint, given or guessed."""
    guessed: bool
    """Whether any of the radii is guessed."""
    tip_joints: Indices
    """`(F,)` the OpenXR tip of each finger."""
    length_ratio: float
    """Length of its fingers, from root to tip, relative to the model's."""


class _Finger(NamedTuple):
    number: int
    joints: list[int]
    """OpenXR joints that are there, from the root to the tip."""


def avatar_hand(profile: ProfileHand, side: Side, model: Hand) -> AvatarHand:
    """The hand of a profile; `model` is the hand that is synthesised."""
    joints = _canonical(profile.joints, side)
    fingers = [_Finger(f, chain) for f, row in enumerate(FINGERS) if (chain := present_joints(joints, row))]
    radii = _radii(profile.radii, joints, fingers, model)
    return _Builder(joints, fingers, model).build(radii, bool(np.isnan(profile.radii).any()))


def _canonical(joints: Array, side: Side) -> Array:
    right = mirror_poses(joints) if side == "left" else joints
    return np.hstack([quat_rotate(_Q_WRIST_OPENXR, right[:, :3]), quat_multiply(_Q_WRIST_OPENXR, right[:, 3:])])


def _radii(given: Array, joints: Array, fingers: list[_Finger], model: Hand) -> Array:
    """`(26,)` the given radii; the others are the model's, scaled by the length of the finger or of the palm."""
    theirs, positions = model_radii(model), forward_kinematics(model, np.zeros(model.angle_count))[0]
    radii = given.copy()
    palm = np.mean([np.linalg.norm(joints[f.joints[0], :3]) for f in fingers])
    of_model = np.mean([np.linalg.norm(positions[OUR_JOINTS[f.joints[0]]]) for f in fingers])
    scale = np.full(len(radii), palm / of_model)
    for finger in fingers:
        ours = sum(np.linalg.norm(joints[b, :3] - joints[a, :3]) for a, b in pairwise(finger.joints))
        path = [positions[OUR_JOINTS[k]] for k in finger.joints]
        model_length = sum(np.linalg.norm(b - a) for a, b in pairwise(path))
        row = FINGERS[finger.number]
        scale[list(row if finger.number == 0 else row[1:])] = ours / model_length
    missing = np.isnan(radii)
    radii[missing] = (theirs * scale)[missing]
    return radii


class _Builder:
    """Makes the hand of one avatar, finger by finger."""

    def __init__(self, joints: Array, fingers: list[_Finger], model: Hand) -> None:
        self._joints, self._fingers, self._model = joints, fingers, model
        self._positions, self._matrices = forward_kinematics(model, np.zeros(model.angle_count))
        self._frames = quat_to_matrix(np.where(np.isnan(joints[:, 3:]), [0.0, 0, 0, 1], joints[:, 3:]))
        self.bone_of = {}
        self.names, self.parents, self.offsets, self.rest = ["WRIST"], [-1], [np.zeros(3)], [np.eye(3)]
        self.angle_names, self.angle_bones, self.axes, self.limits = [], [], [], []
        self.follow, self.rest_angles = [], []
        self.zero = [np.eye(3)]
        """Frame of each bone at the profile's rest."""

    def build(self, radii: Array, guessed: bool) -> AvatarHand:
        for finger in self._fingers:
            self._add_finger(finger)
        bones = len(self.rest)
        tips = []
        for n, finger in enumerate(self._fingers):
            last, tip = self.bone_of[finger.joints[-2]], finger.joints[-1]
            self.parents.append(last)
            self.offsets.append(self.zero[last].T @ (self._joints[tip, :3] - self._joints[finger.joints[-2], :3]))
            self.names.append(OPENXR_JOINT_NAMES[tip])
            tips.append(bones + n)
        chains = tuple((*(self.bone_of[k] for k in f.joints[:-1]), t) for f, t in zip(self._fingers, tips, strict=True))
        capsules, capsule_radii = self._capsules(chains, radii)
        hand = Hand(
            "avatar",
            tuple(self.names),
            np.array(self.parents),
            np.array(self.offsets),
            matrix_to_quat(np.array(self.rest)),
            tuple(self.angle_names),
            np.array(self.angle_bones),
            np.array(self.axes),
            np.array(self.limits),
            chains,
            np.array(capsules),
            np.array(capsule_radii),
            _no_skin(len(self.axes)),
            _no_sensors(),
        )
        rest_angles = np.array(self.rest_angles)
        limits = hand.limits
        limits[:, 0] = np.minimum(limits[:, 0], rest_angles)
        limits[:, 1] = np.maximum(limits[:, 1], rest_angles)
        places = self._places(hand, rest_angles)
        tip_joints = np.array([f.joints[-1] for f in self._fingers])
        return AvatarHand(hand, places, np.array(self.follow), radii, guessed, tip_joints, self._length_ratio())

    def _length_ratio(self) -> float:
        ours = theirs = 0.0
        for finger in self._fingers:
            row = [self._joints[k, :3] for k in finger.joints]
            ours += sum(float(np.linalg.norm(b - a)) for a, b in pairwise(row))
            path = [self._positions[OUR_JOINTS[k]] for k in finger.joints]
            theirs += sum(float(np.linalg.norm(b - a)) for a, b in pairwise(path))
        return ours / theirs

    def _add_finger(self, finger: _Finger) -> None:
        start, after = finger.joints[:2]
        direction = unit(self._joints[after, :3] - self._joints[start, :3])
        first = _ROOT_ANGLES[finger.number]
        axes = [self._matrices[self._model.parents[b]] @ a for b, a in self._hinges(first)]
        along = self._model_direction(start, after)
        turns = aim_hinges(axes[0], axes[1], along, direction)
        zero = (turn_matrix(axes[0], turns[0]) @ turn_matrix(axes[1], turns[1])).T @ self._frame(start, direction)
        bone = self._add_bone(start, 0, self._joints[start, :3], zero)
        for angle, axis, turn in zip(first, axes, turns, strict=True):
            self._add_angle(bone, axis, angle, turn)
        self.zero.append(self._frame(start, direction))
        dropped = self._angles_between(finger, start, after)
        self._spread(dropped)
        for (before, here), there in zip(pairwise(finger.joints[:-1]), finger.joints[2:], strict=True):
            self._add_phalanx(finger, before, here, there)

    def _add_phalanx(self, finger: _Finger, before: int, here: int, there: int) -> None:
        came = unit(self._joints[here, :3] - self._joints[before, :3])
        along = unit(self._joints[there, :3] - self._joints[here, :3])
        frame = self._frame(here, along)
        hinge = -frame[:, 0]
        model_bone = OUR_BONES[here]
        model_frame = self._model_frame(here)
        bend = bend_between(came, along, hinge)
        bend -= bend_between(
            self._model_direction(before, here), self._model_direction(here, there), -model_frame[:, 0]
        )
        parent = self.bone_of[before]
        axis = self.zero[parent].T @ hinge
        rest = turn_matrix(axis, bend).T @ self.zero[parent].T @ frame
        offset = self.zero[parent].T @ (self._joints[here, :3] - self._joints[before, :3])
        bone = self._add_bone(here, parent, offset, rest)
        angle = int(np.flatnonzero(self._model.angle_bones == model_bone)[0])
        self._add_angle(bone, axis, angle, bend)
        self.zero.append(frame)
        self._spread(self._angles_between(finger, here, there))

    def _add_bone(self, joint: int, parent: int, offset: Array, rest: Array) -> int:
        bone = len(self.rest)
        self.bone_of[joint] = bone
        self.names.append(OPENXR_JOINT_NAMES[joint])
        self.parents.append(parent)
        self.offsets.append(offset)
        self.rest.append(rest)
        return bone

    def _add_angle(self, bone: int, axis: Array, model_angle: int, rest_angle: float) -> None:
        self.angle_bones.append(bone)
        self.axes.append(axis)
        self.angle_names.append(self._model.angle_names[model_angle])
        lower, upper = self._model.limits[model_angle]
        self.limits.append([lower - EXTRA_LIMIT_RAD, upper + EXTRA_LIMIT_RAD])
        self.rest_angles.append(rest_angle)
        follow = np.zeros(self._model.angle_count)
        follow[model_angle] = 1.0
        self.follow.append(follow)

    def _hinges(self, angles: tuple[int, int]) -> list[tuple[int, Array]]:
        return [(int(self._model.angle_bones[a]), self._model.axes[a]) for a in angles]

    def _angles_between(self, finger: _Finger, start: int, end: int) -> list[int]:
        """The model's angles at joints of the finger that the avatar lacks between two that it has."""
        lost = [k for k in FINGERS[finger.number] if start < k < end]
        return [a for k in lost for a in np.flatnonzero(self._model.angle_bones == OUR_BONES[k]).tolist()]

    def _spread(self, dropped: list[int]) -> None:
        """Let the last angle take half of each turn of the joints that are missing after it."""
        for angle in dropped:
            self.follow[-1][angle] = 0.5

    def _frame(self, joint: int, along: Array) -> Array:
        """The OpenXR frame of a joint, made exactly perpendicular to its bone, which points `along`."""
        return openxr_frame(along, self._frames[joint][:, 1])

    def _model_direction(self, start: int, end: int) -> Array:
        return unit(self._positions[OUR_JOINTS[end]] - self._positions[OUR_JOINTS[start]])

    def _model_frame(self, joint: int) -> Array:
        bone = OUR_BONES[joint]
        angle = int(np.flatnonzero(self._model.angle_bones == bone)[-1])
        hinge = self._matrices[self._model.parents[bone]] @ self._model.axes[angle]
        child = self._model.parents.tolist().index(bone)
        along = self._positions[child] - self._positions[bone]
        return openxr_frame(unit(along), np.cross(along, hinge))

    def _capsules(self, chains: tuple[tuple[int, ...], ...], radii: Array) -> tuple[list, list]:
        capsules, sizes = [], []
        for finger, chain in zip(self._fingers, chains, strict=True):
            if finger.number:
                capsules.append([0, chain[0]])
                sizes.append(radii[FINGERS[finger.number][0]])
        for finger, chain in zip(self._fingers, chains, strict=True):
            for joint, (start, end) in zip(finger.joints, pairwise(chain), strict=False):
                capsules.append([start, end])
                sizes.append(radii[joint])
        return capsules, sizes

    def _places(self, hand: Hand, rest_angles: Array) -> OpenXrPlaces:
        positions, frames = forward_kinematics(hand, rest_angles)
        bones, points = np.zeros(len(self._joints), np.int64), np.zeros((len(self._joints), 3))
        turns = np.tile([0.0, 0, 0, 1], (len(self._joints), 1))
        for row in FINGERS:
            last = 0
            for k in row:
                last = self.bone_of.get(k, last)
                bones[k] = last
        for k, pose in enumerate(self._joints):
            bone = bones[k]
            if np.isnan(pose[0]):  # a joint that is missing stays with the one before it
                before = [j for row in FINGERS if k in row for j in row if j < k and not np.isnan(self._joints[j, 0])]
                pose = self._joints[before[-1]] if before else self._joints[1]
            points[k] = frames[bone].T @ (pose[:3] - positions[bone])
            turns[k] = matrix_to_quat(frames[bone].T @ quat_to_matrix(pose[3:]))
        of_message = {OUR_BONES[k]: b for k, b in self.bone_of.items()}
        angle_of = np.array([of_message.get(bone, -1) for bone in range(17)])
        local = np.array([frames[max(p, 0)].T @ f for p, f in zip(hand.parents, frames, strict=False)])
        own = np.tile([0.0, 0, 0, 1], (len(frames), 1))
        for k, bone in self.bone_of.items():
            own[bone] = turns[k]
        return OpenXrPlaces(bones, points, turns, angle_of, matrix_to_quat(local), own)


def _no_skin(angles: int) -> Skin:
    empty = np.zeros((0, 3))
    return Skin(empty, np.zeros((0, 3), np.int32), np.zeros((0, 1), np.int64), np.zeros((0, 1)), np.zeros(angles))


def _no_sensors() -> Sensors:
    return Sensors(np.zeros((0, 2), np.int64), np.zeros((0, 2)), np.zeros((0, 2, 3)), np.zeros((0, 2, 3)), np.zeros(3))
