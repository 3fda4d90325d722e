"""Armatures for the tests in Blender, and what a test wants to know about them."""

# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

import bpy
import numpy as np
from mathutils import Vector

FINGERS = ("Thumb", "Index", "Middle", "Ring", "Pinky")
KNUCKLES = ((0.03, 0.03), (0.09, 0.03), (0.095, 0.0), (0.09, -0.02), (0.08, -0.04))
LINK_M = 0.03


def armature(name="Rig", sides=("Left", "Right"), scale=1.0, connected=False, arms=False, without=(), rename=None):
    """A person in T-pose with Mixamo's names, facing -y; at `scale` 0.01 its bones are in centimetres.

    `without` names bones that it lacks, and `rename` changes the names of bones.
    """
    data = bpy.data.armatures.new(name)
    made = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(made)
    bpy.context.view_layer.objects.active = made
    bpy.ops.object.mode_set(mode="EDIT")

    def add(bone, head, tail, parent=None, connect=False):
        if bone in without:
            return parent
        new = data.edit_bones.new((rename or str)(bone))
        new.head, new.tail = Vector(head) / scale, Vector(tail) / scale
        new.roll = 0.7
        new.parent, new.use_connect = parent, connect and parent is not None
        return new

    for side in sides:
        x = 1.0 if side == "Left" else -1.0
        wrist = Vector((0.7 * x, 0.0, 1.4))
        parent = None
        if arms:
            upper = add(f"{side}Arm", (0.2 * x, 0.0, 1.4), (0.45 * x, 0.02, 1.4))
            parent = add(f"{side}ForeArm", (0.45 * x, 0.02, 1.4), wrist, upper, True)
        hand = add(f"{side}Hand", wrist, wrist + Vector((0.08 * x, 0, 0)), parent, connected)
        for finger, (along, across) in zip(FINGERS, KNUCKLES, strict=True):
            bone = hand
            start = wrist + Vector((along * x, -across, -0.005))
            way = Vector((x, -0.8, -0.2)).normalized() if finger == "Thumb" else Vector((x, 0, 0))
            for part in range(3):
                bone = add(f"{side}Hand{finger}{part + 1}", start, start + LINK_M * way, bone)
                start = start + LINK_M * way
    bpy.ops.object.mode_set(mode="OBJECT")
    made.scale = (scale,) * 3
    bpy.context.view_layer.update()
    return made


def skin(rig, names, radius_m=0.008):
    """A mesh that the bones deform: for each name a tube about the bone's rest, with a point at its far end."""
    points, faces, groups = [], [], []
    for name in names:
        bone = rig.data.bones[name]
        place = rig.matrix_world @ bone.matrix_local
        length = bone.length * rig.matrix_world.median_scale
        first = len(points)
        for k in range(48):
            along, angle = (k // 12) / 3.0, 2.0 * np.pi * (k % 12) / 12.0
            ring = Vector((radius_m * np.cos(angle), 0.0, radius_m * np.sin(angle)))
            rotation = place.to_quaternion()
            points.append(place.to_translation() + rotation @ (ring + Vector((0.0, along * length, 0.0))))
        points.append(place.to_translation() + place.to_quaternion() @ Vector((0.0, length + radius_m, 0.0)))
        for k in range(36):
            row, next_ = 12 * (k // 12), (k + 1) % 12
            faces.append([first + k, first + row + next_, first + row + 12 + next_, first + k + 12])
        faces += [[first + 36 + k, first + 36 + (k + 1) % 12, first + 48] for k in range(12)]
        groups.append((name, list(range(first, first + 49))))
    data = bpy.data.meshes.new("Skin")
    data.from_pydata(points, [], faces)
    data.shade_smooth()  # a flat face has vertices of its own in an exported file, and more of them move medians
    made = bpy.data.objects.new("Skin", data)
    bpy.context.scene.collection.objects.link(made)
    for name, indices in groups:
        made.vertex_groups.new(name=name).add(indices, 1.0, "REPLACE")
    made.modifiers.new("Armature", "ARMATURE").object = rig
    made.parent = rig
    made.matrix_parent_inverse = rig.matrix_world.inverted()
    bpy.context.view_layer.update()
    return made


def keyed_action(target, name, keys):
    """An action of the user, assigned to the object: a value for each data path, index and frame."""
    action = bpy.data.actions.new(name)
    (target.animation_data or target.animation_data_create()).action = action
    for (path, index), values in keys.items():
        for frame, value in values.items():
            owner, _, attribute = path.rpartition(".")
            found = target.path_resolve(owner) if owner else target
            getattr(found, attribute)[index] = value
            found.keyframe_insert(attribute, index=index, frame=frame)
    return action


def curves_of(action):
    """All F-curves of an action, by data path and index."""
    if not hasattr(action, "slots"):
        return {(curve.data_path, curve.array_index): curve for curve in action.fcurves}
    bags = (bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags)
    return {(curve.data_path, curve.array_index): curve for bag in bags for curve in bag.fcurves}


def keys_of(action):
    """The keyframes of an action, to compare it with itself later."""
    return {key: [tuple(point.co) for point in curve.keyframe_points] for key, curve in curves_of(action).items()}


def deviations_deg(rig, hand, name_of, absolute=False):
    """The angles in degrees between the finger bones of a rig and those of a shown hand.

    `name_of(finger, part)` names a bone of the rig, or is None. Unless `absolute`, the hand as a whole may be turned.
    """
    ours, theirs = [], []
    world = rig.matrix_world.to_3x3()
    for finger in range(5):
        for part in range(3):
            name = name_of(finger, part)
            if name is not None:
                bone = rig.pose.bones[name]
                theirs.append(np.array((world @ (bone.tail - bone.head)).normalized()))
                joint = 2 + part if finger == 0 else 7 + 5 * (finger - 1) + part
                x, y, z = hand.joints[joint + 1, :3] - hand.joints[joint, :3]
                ours.append(np.array([x, -z, y]) / np.linalg.norm([x, y, z]))
    ours, theirs = np.array(ours), np.array(theirs)
    turn = np.eye(3) if absolute else _best_turn(ours, theirs)
    return np.degrees(np.arccos(np.clip(np.sum((ours @ turn.T) * theirs, axis=1), -1.0, 1.0)))


def _best_turn(ours, theirs):
    """The rotation `(3, 3)` that brings the directions `ours (N, 3)` nearest to `theirs`."""
    u, _, vt = np.linalg.svd(theirs.T @ ours)
    return u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
