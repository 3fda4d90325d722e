"""The settings, which Blender saves in the scene."""

import bpy

from .bones import ALL_PARTS
from .character import Cast
from .session import CONTROL, session


def _send_look_ahead(chosen, _) -> None:
    if session.remote is not None:
        session.remote.send("look_ahead", seconds=chosen.look_ahead)


class ManipNetBone(bpy.types.PropertyGroup):
    """An entry of a bone map: `name` is a part of a hand, and `bone` the bone of the armature for it."""

    bone: bpy.props.StringProperty(name="Bone", description="Bone of the armature; empty to find it by its name")


class ManipNetCharacter(bpy.types.PropertyGroup):
    """An actor and the armature that shows it."""

    actor: bpy.props.StringProperty(
        name="Actor", description="Actor whose hands are shown; empty for the first one received"
    )
    armature: bpy.props.PointerProperty(
        name="Armature",
        type=bpy.types.Object,
        poll=lambda _, found: found.type == "ARMATURE",
        description="Armature whose fingers follow; without one, empties show the joints",
    )
    follow_wrists: bpy.props.BoolProperty(
        name="Follow wrists", description="Also bring the hands to the tracked wrists"
    )
    solve_on_avatar: bpy.props.BoolProperty(
        name="Solve on this avatar",
        description="Let the server solve contact on the hands of this armature, so that what touches still touches",
    )
    show_bones: bpy.props.BoolProperty(name="Bones", description="Choose the bones of the hands by hand")
    bones: bpy.props.CollectionProperty(type=ManipNetBone)

    def bone_map(self) -> dict[str, str]:
        """The bones that the user has chosen, by their parts."""
        return {each.name: each.bone for each in self.bones if each.bone}

    def set_bone_map(self, bone_map: dict[str, str]) -> None:
        """Show all parts, with these bones."""
        self.bones.clear()
        for part in ALL_PARTS:
            entry = self.bones.add()
            entry.name, entry.bone = part, bone_map.get(part, "")


class Settings(bpy.types.PropertyGroup):
    """The settings of a scene."""

    address: bpy.props.StringProperty(
        name="Server", default="tcp://127.0.0.1:5555", description="Address for hands in the server's line `ready`"
    )
    control_address: bpy.props.StringProperty(
        name="Control",
        default=CONTROL,
        description="Address for control in the server's line `ready`, for the meshes of props, avatars and requests",
    )
    delay: bpy.props.FloatProperty(
        name="Delay",
        default=0.1,
        min=0.0,
        max=0.5,
        unit="TIME_ABSOLUTE",
        description="Time by which the hands are shown late, to bridge jitter and lost frames",
    )
    show_props: bpy.props.BoolProperty(name="Props", description="Show the tracked bodies, with the meshes of props")
    characters: bpy.props.CollectionProperty(type=ManipNetCharacter)
    take_name: bpy.props.StringProperty(
        name="Take", description="Name of the next recording on the server's machine; empty for the date and time"
    )
    look_ahead: bpy.props.FloatProperty(
        name="Look-ahead",
        default=0.5,
        min=0.0,
        max=0.5,
        unit="TIME_ABSOLUTE",
        description="Future motion that the server waits for: more is better, less is sooner. Sent when it is changed",
        update=_send_look_ahead,
    )
    start_at: bpy.props.EnumProperty(
        name="Start",
        items=(
            ("CURRENT", "Current frame", "Keyframes begin at the scene's current frame"),
            ("SCENE", "First frame", "Keyframes begin at the scene's first frame"),
            ("TIMECODE", "Timecode", "Keyframes begin at the tracker's timecode, counted in frames of the scene"),
        ),
    )
    within_scene: bpy.props.BoolProperty(
        name="Within scene", description="Make no keyframes after the scene's end, instead of moving the end"
    )
    keys_per_second: bpy.props.FloatProperty(
        name="Keys per second", default=0.0, min=0.0, max=240.0, description="0 makes one key for each frame"
    )

    def cast(self) -> list[Cast]:
        """The characters of the scene."""
        return [
            Cast(each.actor, each.armature, each.follow_wrists, each.bone_map(), each.solve_on_avatar)
            for each in self.characters
        ]


GROUPS = (ManipNetBone, ManipNetCharacter, Settings)
