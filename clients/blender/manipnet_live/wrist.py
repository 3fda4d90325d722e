"""Three ways to bring the hand of an armature to a tracked wrist, of which `wrist_for` chooses the one that works.

A free hand bone is moved itself. A rig with a control for the hand is moved by that control. A hand bone that is
connected to the forearm cannot be moved, so inverse kinematics turns the arm towards an empty at the wrist.
"""

from __future__ import annotations

import bpy
from mathutils import Matrix

from .bones import HandBones
from .scene import Reference, own_object, rotate_to

CONSTRAINT = "ManipNet"


class WristBone:
    """Moves one bone: the hand itself, or the control of the hand."""

    def __init__(self, armature: bpy.types.Object, bone: str, hand: str) -> None:
        bones = armature.data.bones
        self._name = bone
        self._offset = bones[hand].matrix_local.inverted() @ bones[bone].matrix_local
        self.rotated, self.moved = (bone,), (bone,)

    def place(self, armature: bpy.types.Object, wanted: Matrix) -> None:
        """Move the hand to the pose `wanted` in the armature's space. The scale of the bone stays as it is."""
        bone = armature.pose.bones[self._name]
        basis = local_pose(bone, wanted @ self._offset, bone.parent.matrix if bone.parent else None)
        bone.location = basis.to_translation()
        rotate_to(bone, basis.to_quaternion())

    def release(self, armature: bpy.types.Object) -> None:
        """Nothing is left behind."""


class WristTarget:
    """Turns upper arm and forearm towards an empty, and the hand as the empty, by constraints while a session runs."""

    def __init__(self, armature: bpy.types.Object, side: str, hand: str) -> None:
        forearm = armature.data.bones[hand].parent
        self._hand, self._forearm = hand, forearm.name
        self._chain = (forearm.parent.name, forearm.name) if forearm.parent else (forearm.name,)
        self._target_name = f"manipnet_{armature.name}_{side}_target"
        self._target: Reference | None = None
        self.rotated, self.moved = (*self._chain, hand), ()

    def place(self, armature: bpy.types.Object, wanted: Matrix) -> None:
        """Move the empty to the pose `wanted` in the armature's space."""
        target = self._target.find() if self._target else None
        if target is None or not target.users_collection:
            target = own_object(self._target_name, size_m=0.05)
            self._target = Reference(target)
        place, rotation, _ = (armature.matrix_world @ wanted).decompose()
        target.location = place
        rotate_to(target, rotation)
        reach = _constraint(armature.pose.bones[self._forearm], "IK", target)
        reach.chain_count = len(self._chain)
        _constraint(armature.pose.bones[self._hand], "COPY_ROTATION", target)

    def release(self, armature: bpy.types.Object) -> None:
        """Remove the constraints and the empty."""
        bones = armature.pose.bones
        for name in (each for each in (self._forearm, self._hand) if each in bones):
            constraints = bones[name].constraints
            for each in [each for each in constraints if each.name == CONSTRAINT]:
                constraints.remove(each)
        if self._target is not None and (target := self._target.find()) is not None:
            bpy.data.objects.remove(target)


def wrist_for(armature: bpy.types.Object, side: str, bones: HandBones) -> WristBone | WristTarget:
    """The way to move the hand of this armature."""
    hand = armature.data.bones[bones.hand]
    if bones.control is None and hand.use_connect and hand.parent is not None:
        return WristTarget(armature, side, bones.hand)
    return WristBone(armature, bones.control or bones.hand, bones.hand)


def local_pose(bone: bpy.types.PoseBone, pose: Matrix, parent_pose: Matrix | None) -> Matrix:
    """The own transformation of a bone which, below a parent in `parent_pose`, brings it into `pose`.

    Both poses are in the armature's space. Blender knows what the bone inherits from its parent.
    """
    rest = bone.bone
    if parent_pose is None or rest.parent is None:
        return rest.convert_local_to_pose(pose, rest.matrix_local, invert=True)
    return rest.convert_local_to_pose(
        pose,
        rest.matrix_local,
        parent_matrix=parent_pose,
        parent_matrix_local=rest.parent.matrix_local,
        invert=True,
    )


def _constraint(bone: bpy.types.PoseBone, kind: str, target: bpy.types.Object) -> bpy.types.Constraint:
    found = next((each for each in bone.constraints if each.name == CONSTRAINT and each.type == kind), None)
    if found is None:
        found = bone.constraints.new(kind)
        found.name = CONSTRAINT
    if found.target != target:
        found.target = target
    return found
