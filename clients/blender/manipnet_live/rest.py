"""The rest pose of the hands of an armature, and the skin on them."""

from __future__ import annotations

import bpy
import numpy as np

from .axes import xyzw
from .bones import HandBones, RigError
from .manipnet_client.avatar import RigHand
from .manipnet_client.retarget import rotate

NEAR_M = 1e-3
_HELPERS = ("DEF-", "ORG-", "MCH-")


def bind_pose(armature: bpy.types.Object, bones: HandBones) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The rest pose of the finger bones in the space of the hand bone, with NaN for a missing bone.

    Returns positions `(15, 3)` in units of the armature, rotations `(15, 4)` xyzw, and ends of the fingers `(5, 3)`.
    """
    hand = armature.data.bones[bones.hand]
    to_hand, origin = xyzw(hand.matrix_local.inverted().to_quaternion()), np.array(hand.head_local)
    positions, rotations, tips = np.full((15, 3), np.nan), np.full((15, 4), np.nan), np.full((5, 3), np.nan)
    for row, name in enumerate(bones.fingers):
        if name is not None:
            bone = armature.data.bones[name]
            positions[row] = rotate(to_hand, np.array(bone.head_local) - origin)
            tips[row // 3] = rotate(to_hand, np.array(bone.tail_local) - origin)
            rotations[row] = xyzw((hand.matrix_local.inverted() @ bone.matrix_local).to_quaternion())
    return positions, rotations, tips


def rig_hand(armature: bpy.types.Object, bones: HandBones) -> RigHand:
    """The rest pose of a hand in metres, with its skin. Raises `RigError` if the armature is stretched or mirrored."""
    scale = _scale(armature)
    positions, rotations, tails = bind_pose(armature, bones)
    hand = armature.data.bones[bones.hand].matrix_local
    to_hand = scale * np.array(hand.inverted().to_3x3())
    origin = np.array(hand.to_translation())
    tips, metacarpals = np.full((5, 3), np.nan), np.full((4, 3), np.nan)
    for finger in range(5):
        last = next((name for name in reversed(bones.fingers[3 * finger : 3 * finger + 3]) if name is not None), None)
        if last is not None and (tip := _tip(armature.data.bones[last], NEAR_M / scale)) is not None:
            tips[finger] = to_hand @ (tip - origin)
    for row, name in enumerate(bones.metacarpals):
        if name is not None:
            metacarpals[row] = to_hand @ (np.array(armature.data.bones[name].head_local) - origin)
    skin, owners = _skin(armature, bones)
    skin = (skin - origin) @ to_hand.T
    return RigHand(scale * positions, rotations, tips, scale * tails, metacarpals, skin, owners)


def _scale(armature: bpy.types.Object) -> float:
    """Metres per unit of the armature."""
    x, y, z = armature.matrix_world.to_scale()
    if min(x, y, z) <= 0.0 or max(x, y, z) > 1.01 * min(x, y, z):
        raise RigError(
            f"{armature.name} is mirrored or stretched (its scale is {x:.3g}, {y:.3g}, {z:.3g}); apply its scale with "
            "Object > Apply > Scale, or give it the same positive scale on all axes"
        )
    return (x + y + z) / 3.0


def _tip(last: bpy.types.Bone, near: float) -> np.ndarray | None:
    """The head of a bone at the end of a finger, as Mixamo's fourth ones; helper bones do not count."""
    for child in last.children:
        if not child.name.startswith(_HELPERS) and (child.head_local - last.head_local).length > near:
            return np.array(child.head_local)
    return None


def _skin(armature: bpy.types.Object, bones: HandBones) -> tuple[np.ndarray, np.ndarray]:
    """Points of the skin in the armature's space `(V, 3)`, and for each the row of its finger bone `(V,)`."""
    rows = {name: row for row, name in enumerate(bones.fingers) if name is not None}
    rows |= {f"DEF-{name}": row for name, row in rows.items()}  # Rigify's controls have bones that deform for them
    points, owners = [np.empty((0, 3))], [np.empty(0, int)]
    for mesh in bpy.data.objects:
        if mesh.type != "MESH" or not any(m.type == "ARMATURE" and m.object == armature for m in mesh.modifiers):
            continue
        row_of_group = {group.index: rows[group.name] for group in mesh.vertex_groups if group.name in rows}
        own = [_owner(vertex, row_of_group) for vertex in mesh.data.vertices] if row_of_group else []
        chosen = np.array([index for index, row in enumerate(own) if row >= 0], int)
        if len(chosen):
            flat = np.empty(3 * len(mesh.data.vertices))
            mesh.data.vertices.foreach_get("co", flat)
            place = np.array(armature.matrix_world.inverted() @ mesh.matrix_world)
            points.append(flat.reshape(-1, 3)[chosen] @ place[:3, :3].T + place[:3, 3])
            owners.append(np.array(own)[chosen])
    return np.concatenate(points), np.concatenate(owners)


def _owner(vertex: bpy.types.MeshVertex, row_of_group: dict[int, int]) -> int:
    """The row of the finger bone that moves a vertex most, or -1 if another bone does."""
    heaviest = max(vertex.groups, key=lambda each: each.weight, default=None)
    return -1 if heaviest is None else row_of_group.get(heaviest.group, -1)
