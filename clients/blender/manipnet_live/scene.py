"""Objects of the scene: finding them again after undo and renaming, and making those that belong to the extension."""

import bpy
import mathutils

MARK = "manipnet_live"
"""The custom property of objects that the extension has made. It never takes over an object of the user."""


class Reference:
    """An object that is looked up at each use, since undo replaces objects and users delete and rename them."""

    def __init__(self, target: bpy.types.Object) -> None:
        self._uid, self.name = target.session_uid, target.name

    def find(self) -> bpy.types.Object | None:
        """The object, or None while it does not exist."""
        found = bpy.data.objects.get(self.name)
        if found is None or found.session_uid != self._uid:
            found = next((each for each in bpy.data.objects if each.session_uid == self._uid), None)
        if found is not None:
            self.name = found.name
        return found


def own_object(name: str, data: bpy.types.Mesh | None = None, size_m: float = 0.01) -> bpy.types.Object:
    """The object `name` of the extension, which is made if it is missing: a mesh object, or an empty with arrows."""
    found = next((each for each in bpy.data.objects if each.get(MARK) == name), None)
    if found is None:
        found = bpy.data.objects.new(name, data)
        found[MARK] = name
        found.rotation_mode = "QUATERNION"
        if data is None:
            found.empty_display_type = "ARROWS"
            found.empty_display_size = size_m
    if not found.users_collection:
        _own_collection().objects.link(found)
    return found


def _own_collection() -> bpy.types.Collection:
    scene = bpy.context.scene
    found = next((each for each in scene.collection.children if each.get(MARK)), None)
    if found is None:
        found = bpy.data.collections.new("ManipNet")
        found[MARK] = True
        scene.collection.children.link(found)
    return found


def rotation_of(target: bpy.types.Object | bpy.types.PoseBone) -> mathutils.Quaternion:
    """The rotation of an object or a pose bone, whatever its rotation mode."""
    if target.rotation_mode == "QUATERNION":
        return target.rotation_quaternion.copy()
    if target.rotation_mode == "AXIS_ANGLE":
        angle, *axis = target.rotation_axis_angle
        return mathutils.Quaternion(axis, angle)
    return target.rotation_euler.to_quaternion()


def rotate_to(target: bpy.types.Object | bpy.types.PoseBone, rotation: mathutils.Quaternion) -> None:
    """Set the rotation in the target's own rotation mode, so that the user's animation in that mode still works."""
    if target.rotation_mode == "QUATERNION":
        target.rotation_quaternion = rotation
    elif target.rotation_mode == "AXIS_ANGLE":
        axis, angle = rotation.to_axis_angle()
        target.rotation_axis_angle = (angle, *axis)
    else:
        target.rotation_euler = rotation.to_euler(target.rotation_mode, target.rotation_euler)
