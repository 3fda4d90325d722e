"""Write the profile of a skinned rig, and the rig as a GLB file: `python export_avatar.py RIG EXTENSIONS - FOLDER`."""

# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

import json
from pathlib import Path

import bpy
import scenarios
from manipnet_live.bones import SIDES
from manipnet_live.manipnet_client.avatar import avatar_profile
from manipnet_live.rig import ArmatureHand
from rigs import armature, skin


def mixamo():
    """A rig in centimetres."""
    export(armature(scale=0.01, arms=True))


def metarig():
    """Rigify's human, which has bones in the palm."""
    bpy.ops.preferences.addon_enable(module="rigify")
    bpy.ops.object.armature_human_metarig_add()
    export(bpy.context.object)


def export(rig):
    """Write both files."""
    hands = {side: ArmatureHand(rig, side, False, {}, True) for side in SIDES}
    skin(rig, [name for hand in hands.values() for name in hand.bones.fingers])
    hands = {side: ArmatureHand(rig, side, False, {}, True) for side in SIDES}
    profile = avatar_profile("avatar", {side: hand.avatar for side, hand in hands.items()})
    folder = Path(scenarios.FOLDER)
    (folder / "profile.json").write_text(json.dumps(profile))
    bpy.ops.preferences.addon_enable(module="io_scene_gltf2")
    bpy.ops.export_scene.gltf(filepath=str(folder / "avatar.glb"), export_format="GLB")


scenarios.main(globals())
