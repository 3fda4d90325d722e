"""The tab "ManipNet" in the sidebar of the 3D view."""

import bpy

from .rig import RigError
from .session import session


class Settings(bpy.types.PropertyGroup):
    """The settings, which Blender saves in the scene."""

    address: bpy.props.StringProperty(
        name="Server", default="tcp://127.0.0.1:5555", description="Address for hands in the server's line `ready`"
    )
    actor: bpy.props.StringProperty(
        name="Actor", description="Actor whose hands are shown; empty for the first one received"
    )
    delay: bpy.props.FloatProperty(
        name="Delay",
        default=0.1,
        min=0.0,
        max=0.5,
        unit="TIME_ABSOLUTE",
        description="Time by which the hands are shown late, to bridge jitter and lost frames",
    )
    armature: bpy.props.PointerProperty(
        name="Armature",
        type=bpy.types.Object,
        poll=lambda _, found: found.type == "ARMATURE",
        description="Armature whose fingers follow; without one, empties show the joints",
    )
    follow_wrists: bpy.props.BoolProperty(
        name="Follow wrists", description="Also move the hand bones to the tracked wrists"
    )


class MANIPNET_OT_connect(bpy.types.Operator):  # noqa: N801  (Blender requires such names)
    """Receive hands and show them"""

    bl_idname = "manipnet.connect"
    bl_label = "Connect"

    def execute(self, context):
        chosen = context.scene.manipnet
        try:
            session.start(chosen.address, chosen.actor, chosen.delay, chosen.armature, chosen.follow_wrists)
        except (ValueError, RigError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class MANIPNET_OT_disconnect(bpy.types.Operator):  # noqa: N801  (Blender requires such names)
    """Stop receiving"""

    bl_idname = "manipnet.disconnect"
    bl_label = "Disconnect"

    def execute(self, context):
        session.stop()
        return {"FINISHED"}


class MANIPNET_OT_record(bpy.types.Operator):  # noqa: N801  (Blender requires such names)
    """Record the shown motion. Press again to make keyframes from it, starting at the current frame"""

    bl_idname = "manipnet.record"
    bl_label = "Record"

    @classmethod
    def poll(cls, context):
        return session.can_record

    def execute(self, context):
        if session.is_recording:
            self.report({"INFO"}, f"Made keyframes for {session.stop_recording()} frames")
        else:
            session.start_recording()
        return {"FINISHED"}


class MANIPNET_PT_panel(bpy.types.Panel):  # noqa: N801  (Blender requires such names)
    """Connection, status and recording"""

    bl_idname = "MANIPNET_PT_panel"
    bl_label = "ManipNet Live"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "ManipNet"

    def draw(self, context):
        layout, chosen = self.layout, context.scene.manipnet
        settings = layout.column()
        settings.enabled = not session.is_running
        for name in ("address", "actor", "delay", "armature", "follow_wrists"):
            settings.prop(chosen, name)
        if not session.is_running:
            layout.operator("manipnet.connect", icon="PLAY")
            return
        layout.operator("manipnet.disconnect", icon="PAUSE")
        recording = session.is_recording
        layout.operator(
            "manipnet.record", text="Stop and make keyframes" if recording else "Record", icon="REC", depress=recording
        )
        stats = session.stats()
        layout.label(text=stats.state)
        if stats.received:
            layout.label(text=f"{stats.rate_hz:.1f} Hz, age {1000 * stats.age_s:.0f} ms, {stats.lost} lost")
        else:
            layout.label(text="Nothing has arrived. Is the server running?", icon="INFO")


CLASSES = (Settings, MANIPNET_OT_connect, MANIPNET_OT_disconnect, MANIPNET_OT_record, MANIPNET_PT_panel)
