"""Shows hands in the scene, on the bones of an armature or as empties at the joints."""

import bpy
import mathutils
import numpy as np

from .axes import to_blender, turned_to_blender
from .manipnet_client import Hand
from .manipnet_client.layout import JOINT_NAMES
from .manipnet_client.retarget import (
    FINGERS,
    PARTS,
    HandRig,
    conjugate,
    is_hand,
    is_thumb_metacarpal,
    matches,
    multiply,
    rotate,
)


class RigError(ValueError):
    """An armature has no known fingers; the text names the missing bones."""


def _is_driven(bone_name: str) -> tuple[bool, bool]:
    """Rigify's deforming bones follow its controls, and so do those of Auto-Rig Pro, whose controls begin with c_."""
    return bone_name.startswith("DEF-"), not bone_name.startswith("c_")


class ArmatureHand:
    """One hand of an armature. With any rest pose, its bones point where the synthesised ones do."""

    def __init__(self, armature: bpy.types.Object, side: str, follow_wrist: bool) -> None:
        self._armature, self._side, self._follow_wrist = armature, side, follow_wrist
        bones = {bone.name: bone for bone in sorted(armature.data.bones, key=lambda bone: _is_driven(bone.name))}
        metacarpal = any(is_thumb_metacarpal(name, side) for name in bones)
        hand = next((name for name in bones if is_hand(name, side)), None)
        names = [
            next((name for name in bones if matches(name, side, finger, part, metacarpal)), None)
            for finger in range(len(FINGERS))
            for part in range(len(PARTS))
        ]
        wanted = ["Hand"] + [finger + part for finger in FINGERS for part in PARTS]
        missing = [part for part, name in zip(wanted, [hand, *names], strict=True) if name is None]
        if missing:
            raise RigError(f"{armature.name} has no bone for {', '.join(missing)} of the {side} hand")
        self.bone_names = [str(name) for name in names]
        self.hand_name = str(hand)
        self.moved = [self.hand_name] if follow_wrist else []
        self._bind(bones)

    def _bind(self, bones: dict) -> None:
        hand = bones[self.hand_name]
        to_hand = conjugate(_rotation(hand.matrix_local))
        origin = np.array(hand.head_local)
        found = [bones[name] for name in self.bone_names]

        def local(point: object) -> np.ndarray:
            return rotate(to_hand, np.array(point) - origin)

        self._rest = np.array([multiply(to_hand, _rotation(bone.matrix_local)) for bone in found])
        heads = np.array([local(bone.head_local) for bone in found])
        tips = np.array([local(bone.tail_local) for bone in found[2::3]])
        self._rig = HandRig(self._side, heads, self._rest, tips)
        parents = [bone.parent.name if bone.parent else "" for bone in found]
        self._parents = [self.bone_names.index(name) if name in self.bone_names else -1 for name in parents]

    def solve(self, hand: Hand) -> np.ndarray:
        """The rotation of each bone from its rest pose, `(15, 4)` wxyz as in Blender."""
        turned = self._rig.solve(hand)
        basis = np.empty((len(turned), 4))
        for i, parent in enumerate(self._parents):
            basis[i] = multiply(conjugate(self._rest[i]), turned[i])
            if parent >= 0:
                carried = multiply(self._rest[parent], conjugate(turned[parent]))
                basis[i] = multiply(conjugate(self._rest[i]), multiply(carried, turned[i]))
        return basis[:, [3, 0, 1, 2]]

    def keys(self, hand: Hand) -> tuple[np.ndarray, np.ndarray]:
        """The values of keyframes: rotations wxyz of the bones `bone_names` and `moved`, and locations of `moved`."""
        moved = [self._armature.pose.bones[name] for name in self.moved]
        rotations = [np.array(bone.rotation_quaternion) for bone in moved]
        locations = [np.array(bone.location) for bone in moved]
        return np.vstack([self.solve(hand), *rotations]), np.array(locations).reshape(-1, 3)

    def show(self, hand: Hand, weight: float) -> None:
        """Pose the bones; a `weight` below one blends with their present pose."""
        bones = self._armature.pose.bones
        if self._follow_wrist:
            place = mathutils.Vector(to_blender(hand.wrist)[:3])
            x, y, z, w = turned_to_blender(self._rig.hand_rotation(hand))
            world = mathutils.Matrix.LocRotScale(place, mathutils.Quaternion((w, x, y, z)), None)
            bones[self.hand_name].rotation_mode = "QUATERNION"
            bones[self.hand_name].matrix = self._armature.matrix_world.inverted() @ world
        for name, basis in zip(self.bone_names, self.solve(hand), strict=True):
            bone = bones[name]
            bone.rotation_mode = "QUATERNION"
            if weight < 1.0:
                basis = _mix(np.array(bone.rotation_quaternion), basis, weight)
            bone.rotation_quaternion = basis


class JointEmpties:
    """One hand as empties at its 26 OpenXR joints, +y towards the finger tip. Missing empties are created."""

    def __init__(self, side: str) -> None:
        self._objects = []
        for joint in JOINT_NAMES:
            name = f"manipnet_{side}_{joint}"
            found = bpy.data.objects.get(name) or self._create(name)
            self._objects.append(found)

    def _create(self, name: str) -> bpy.types.Object:
        made = bpy.data.objects.new(name, None)
        made.empty_display_type = "ARROWS"
        made.empty_display_size = 0.01
        made.rotation_mode = "QUATERNION"
        bpy.context.scene.collection.objects.link(made)
        return made

    def show(self, hand: Hand, weight: float) -> None:
        """Move the empties to the joints; after the stream has faded they stay in place."""
        if weight > 0.0:
            for found, joint in zip(self._objects, hand.joints, strict=True):
                x, y, z, qx, qy, qz, qw = to_blender(joint)
                found.location = (x, y, z)
                found.rotation_quaternion = (qw, qx, qy, qz)


def _mix(a: np.ndarray, b: np.ndarray, weight: float) -> np.ndarray:
    mixed = (1.0 - weight) * a + weight * (b if a @ b >= 0.0 else -b)
    return mixed / max(float(np.linalg.norm(mixed)), 1e-6)


def _rotation(matrix: object) -> np.ndarray:
    """The rotation of a 4x4 matrix as a quaternion xyzw."""
    w, x, y, z = mathutils.Matrix(matrix).to_quaternion()
    return np.array([x, y, z, w])
