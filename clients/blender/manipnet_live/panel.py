"""The tab "ManipNet" in the sidebar of the 3D view."""

import bpy

from .session import session


class MANIPNET_PT_panel(bpy.types.Panel):  # noqa: N801  (Blender requires such names)
    """Connection, characters, status and recording"""

    bl_idname = "MANIPNET_PT_panel"
    bl_label = "ManipNet Live"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "ManipNet"

    def draw(self, context):
        layout, chosen = self.layout, context.scene.manipnet
        settings = layout.column()
        settings.enabled = not session.is_running
        for name in ("address", "control_address", "delay", "show_props"):
            settings.prop(chosen, name)
        for index, character in enumerate(chosen.characters):
            _draw_character(settings.box(), index, character)
        settings.operator("manipnet.add_character", icon="ADD")
        if session.is_running:
            layout.operator("manipnet.disconnect", icon="PAUSE")
            _draw_recording(layout, chosen)
            _draw_status(layout)
            _draw_server(layout.box(), chosen)
        else:
            layout.operator("manipnet.connect", icon="PLAY")
        for problem in session.problems:
            layout.label(text=problem, icon="ERROR")


def _draw_character(box, index: int, character) -> None:
    row = box.row()
    row.prop(character, "actor")
    row.operator("manipnet.remove_character", text="", icon="X").index = index
    box.prop(character, "armature")
    if character.armature is None:
        return
    for name in ("follow_wrists", "solve_on_avatar"):
        box.prop(character, name)
    box.prop(character, "show_bones", icon="TRIA_DOWN" if character.show_bones else "TRIA_RIGHT")
    if character.show_bones:
        row = box.row()
        for operator, icon in (("find_bones", "VIEWZOOM"), ("load_bone_map", "IMPORT"), ("save_bone_map", "EXPORT")):
            row.operator(f"manipnet.{operator}", text="", icon=icon).index = index
        for entry in character.bones:
            box.prop_search(entry, "bone", character.armature.data, "bones", text=entry.name)


def _draw_recording(layout, chosen) -> None:
    recording = session.is_recording
    text = "Stop and make keyframes" if recording else "Record"
    layout.operator("manipnet.record", text=text, icon="REC", depress=recording)
    for name in ("start_at", "within_scene", "keys_per_second"):
        layout.prop(chosen, name)


def _draw_status(layout) -> None:
    for character in session.characters:
        stats = character.stats()
        layout.label(text=f"{character.shown.actor}: {stats.state}" if character.shown else stats.state)
        if stats.received:
            layout.label(text=f"{stats.rate_hz:.1f} Hz, age {1000 * stats.age_s:.0f} ms, {stats.lost} lost")
        else:
            layout.label(text="Nothing has arrived. Is the server running?", icon="INFO")


def _draw_server(box, chosen) -> None:
    """What the panel can ask of the server."""
    remote = session.remote
    if remote is None:
        return
    if remote.problem:
        box.label(text=remote.problem, icon="ERROR")
        return
    recording = remote.state.recording is not None
    box.prop(chosen, "take_name")
    text = "Stop Recording on Server" if recording else "Record on Server"
    box.operator("manipnet.record_on_server", text=text, icon="REC", depress=recording)
    for actor, bodies in remote.state.bodies.items():
        for body, carried in bodies.items():
            row = box.row()
            row.label(text=f"{actor}: {body}" if len(remote.state.bodies) > 1 else body)
            menu = row.operator_menu_enum("manipnet.select_object", "object", text=carried["object"] or "Object")
            menu.actor, menu.body = actor, body
    box.prop(chosen, "look_ahead")
    box.operator("manipnet.rest", icon="HAND")
    if remote.message:
        box.label(text=remote.message, icon="INFO")
