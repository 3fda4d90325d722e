"""Poses the hands of an armature, or shows hands as empties at their joints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector

from .axes import quaternion, to_blender, turned_to_blender
from .bones import HandBones, RigError, find_hand
from .manipnet_client import Hand
from .manipnet_client.avatar import AvatarError, AvatarHand
from .manipnet_client.layout import JOINT_NAMES
from .manipnet_client.retarget import HandRig
from .recording import Track
from .rest import bind_pose, rig_hand
from .scene import Reference, own_object, rotate_to, rotation_of
from .wrist import local_pose, wrist_for


@dataclass(frozen=True)
class _FingerBone:
    """How one finger bone is reached from the bones above it."""

    name: str
    row: int
    """Its place among the 15 finger bones."""
    parent: str | None
    anchor: str | None
    """The nearest finger bone above it, or None; helper bones may lie between."""


class ArmatureHand:
    """One hand of an armature. With any rest pose, its bones point where the synthesised ones do.

    If the server solves on this `avatar`, the bones lie where the message for it says.
    """

    def __init__(
        self, armature: bpy.types.Object, side: str, wrist: bool, bone_map: Mapping[str, str], avatar: bool = False
    ) -> None:
        """Raises `RigError` if the armature lacks the hand or two fingers of it, or cannot be solved on."""
        self.bones = find_hand(armature, side, bone_map)
        self._armature = Reference(armature)
        self.avatar = _avatar_hand(armature, side, self.bones) if avatar else None
        """The hand on which the server solves, if it does."""
        self._rig = self.avatar or HandRig(side, *bind_pose(armature, self.bones))
        self._fingers = _finger_bones(armature, self.bones)
        self._wrist = wrist_for(armature, side, self.bones) if wrist else None
        self._wanted: Vector | None = None
        self.distance_m = 0.0
        """How far the hand was from the tracked wrist when Blender last computed the armature."""

    def show(self, hand: Hand, weight: float) -> None:
        """Pose the bones, unless the armature is gone; a `weight` below one blends with their present pose."""
        armature = self._armature.find()
        if armature is None or not self._has_bones(armature):
            return
        bones = armature.pose.bones
        pose = bones[self.bones.hand].matrix.copy()
        if self._wrist is not None:
            self._measure(armature)
            wanted = self._wanted_pose(armature, hand)
            self._wanted = armature.matrix_world @ wanted.to_translation()
            self._wrist.place(armature, wanted)
            pose = wanted
        self._pose_fingers(bones, pose.to_quaternion(), hand, weight)

    def new_track(self) -> Track:
        """A track for a recording, which `record` adds to."""
        wrist = self._wrist
        fingers = tuple(bone.name for bone in self._fingers)
        return Track(self._armature, (*fingers, *(wrist.rotated if wrist else ())), wrist.moved if wrist else ())

    def record(self, track: Track, time_s: float) -> None:
        """Add the present pose of the bones to a track of `new_track`."""
        armature = self._armature.find()
        if armature is None or not self._has_bones(armature):
            return
        bones = armature.pose.bones
        solved = self._wrist.rotated if self._wrist is not None and not self._wrist.moved else ()
        rotations = [
            _shown_rotation(bones[name]) if name in solved else rotation_of(bones[name]) for name in track.rotated
        ]
        track.add(time_s, np.array(rotations), np.array([bones[name].location for name in track.moved]))

    def release(self) -> None:
        """Remove what is in the armature only while the hand is shown."""
        armature = self._armature.find()
        if armature is not None and self._wrist is not None:
            self._wrist.release(armature)

    def _has_bones(self, armature: bpy.types.Object) -> bool:
        """Whether the user has not deleted or renamed a bone in the meantime."""
        names = (self.bones.hand, *(bone.name for bone in self._fingers), *(self._wrist.rotated if self._wrist else ()))
        return all(name in armature.pose.bones for name in names)

    def _wanted_pose(self, armature: bpy.types.Object, hand: Hand) -> Matrix:
        """The pose of the hand bone at the tracked wrist, in the armature's space and without its scale."""
        to_armature = armature.matrix_world.inverted()
        x, y, z = self._rig.hand_place(hand)
        place = to_armature @ Vector((x, -z, y))
        turned = quaternion(turned_to_blender(self._rig.hand_rotation(hand)))
        return Matrix.LocRotScale(place, to_armature.to_quaternion() @ turned, None)

    def _measure(self, armature: bpy.types.Object) -> None:
        if self._wanted is not None:
            place = armature.matrix_world @ armature.pose.bones[self.bones.hand].head
            self.distance_m = (place - self._wanted).length

    def _pose_fingers(self, bones, hand_rotation: Quaternion, hand: Hand, weight: float) -> None:
        """Turn the finger bones; poses of other bones above them are taken relative to the hand or finger above."""
        evaluated_hand = bones[self.bones.hand].matrix.to_quaternion()
        solved = self._rig.solve(hand)
        shown: dict[str, Quaternion] = {}
        for bone in self._fingers:
            wanted = hand_rotation @ quaternion(solved[bone.row])
            parent = None
            if bone.parent is not None:
                above = shown[bone.anchor] if bone.anchor else hand_rotation
                before = bones[bone.anchor].matrix.to_quaternion() if bone.anchor else evaluated_hand
                parent = above @ before.inverted() @ bones[bone.parent].matrix.to_quaternion()
                parent = shown.get(bone.parent, parent).to_matrix().to_4x4()
            target = bones[bone.name]
            basis = local_pose(target, wanted.to_matrix().to_4x4(), parent).to_quaternion()
            rotate_to(target, rotation_of(target).slerp(basis, weight) if weight < 1.0 else basis)
            shown[bone.name] = wanted


class JointEmpties:
    """One hand as empties at its 26 OpenXR joints, +y towards the finger tip. Missing empties are created."""

    def __init__(self, side: str, actor: str = "") -> None:
        start = f"manipnet_{actor}_{side}" if actor else f"manipnet_{side}"
        self._names = [f"{start}_{joint}" for joint in JOINT_NAMES]
        self._found = [Reference(own_object(name)) for name in self._names]

    def show(self, hand: Hand, weight: float) -> None:
        """Move the empties to the joints; after the stream has faded they stay in place."""
        if weight == 0.0:
            return
        for i, joint in enumerate(hand.joints):
            found = self._found[i].find()
            if found is None or not found.users_collection:
                found = own_object(self._names[i])
                self._found[i] = Reference(found)
            pose = to_blender(joint)
            found.location = pose[:3]
            rotate_to(found, quaternion(pose[3:]))


def _avatar_hand(armature: bpy.types.Object, side: str, bones: HandBones) -> AvatarHand:
    try:
        return AvatarHand(side, rig_hand(armature, bones))
    except AvatarError as error:
        raise RigError(f"the server cannot solve on {armature.name}: {error}") from None


def _finger_bones(armature: bpy.types.Object, bones: HandBones) -> list[_FingerBone]:
    """The finger bones that the armature has, from the hand outwards."""
    out = []
    for row, name in enumerate(bones.fingers):
        if name is not None:
            bone = armature.data.bones[name]
            above = next((each.name for each in bone.parent_recursive if each.name in bones.fingers), None)
            out.append(_FingerBone(name, row, bone.parent.name if bone.parent else None, above))
    return sorted(out, key=lambda each: len(armature.data.bones[each.name].parent_recursive))


def _shown_rotation(bone: bpy.types.PoseBone) -> Quaternion:
    """The own rotation that shows the bone as it is now, with the effect of its constraints in it."""
    return local_pose(bone, bone.matrix, bone.parent.matrix if bone.parent else None).to_quaternion()
