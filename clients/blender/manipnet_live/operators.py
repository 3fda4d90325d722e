"""The buttons of the panel."""

from pathlib import Path

import bpy
from bpy_extras.io_utils import ExportHelper, ImportHelper

from .bones import SIDES, RigError, found_parts, read_bone_map, write_bone_map
from .session import session


class MANIPNET_OT_connect(bpy.types.Operator):  # noqa: N801  (Blender requires such names)
    """Receive hands and show them"""

    bl_idname = "manipnet.connect"
    bl_label = "Connect"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012  (Blender requires a set)

    def execute(self, context):
        chosen = context.scene.manipnet
        try:
            session.start(chosen.address, chosen.delay, chosen.cast(), chosen.control_address, chosen.show_props)
        except (ValueError, RigError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for problem in session.problems:
            self.report({"WARNING"}, problem)
        return {"FINISHED"}


class MANIPNET_OT_disconnect(bpy.types.Operator):  # noqa: N801  (Blender requires such names)
    """Stop receiving; a running recording becomes keyframes"""

    bl_idname = "manipnet.disconnect"
    bl_label = "Disconnect"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012  (Blender requires a set)

    def execute(self, context):
        _make_keyframes(self, context)
        session.stop()
        return {"FINISHED"}


class MANIPNET_OT_record(bpy.types.Operator):  # noqa: N801  (Blender requires such names)
    """Record the shown motion. Press again to make keyframes from it"""

    bl_idname = "manipnet.record"
    bl_label = "Record"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012  (Blender requires a set)

    @classmethod
    def poll(cls, context):
        return session.can_record

    def execute(self, context):
        if session.is_recording:
            _make_keyframes(self, context)
        else:
            session.start_recording()
        return {"FINISHED"}


class MANIPNET_OT_add_character(bpy.types.Operator):  # noqa: N801  (Blender requires such names)
    """Show an actor on an armature"""

    bl_idname = "manipnet.add_character"
    bl_label = "Add Character"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012  (Blender requires a set)

    def execute(self, context):
        made = context.scene.manipnet.characters.add()
        if context.object is not None and context.object.type == "ARMATURE":
            made.armature = context.object
        return {"FINISHED"}


class _OfCharacter:
    """An operator for one of the scene's characters."""

    index: bpy.props.IntProperty(options={"HIDDEN"})

    def character(self, context):
        return context.scene.manipnet.characters[self.index]


class MANIPNET_OT_remove_character(_OfCharacter, bpy.types.Operator):  # noqa: N801  (Blender requires such names)
    """Remove this character from the list; the armature stays"""

    bl_idname = "manipnet.remove_character"
    bl_label = "Remove Character"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012  (Blender requires a set)

    def execute(self, context):
        context.scene.manipnet.characters.remove(self.index)
        return {"FINISHED"}


class MANIPNET_OT_find_bones(_OfCharacter, bpy.types.Operator):  # noqa: N801  (Blender requires such names)
    """List the bones of both hands, with those that are found by their names"""

    bl_idname = "manipnet.find_bones"
    bl_label = "Find Bones"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012  (Blender requires a set)

    def execute(self, context):
        character = self.character(context)
        if character.armature is None:
            self.report({"ERROR"}, "Choose an armature first")
            return {"CANCELLED"}
        found = {
            side.capitalize() + part: bone
            for side in SIDES
            for part, bone in found_parts(character.armature, side).items()
        }
        character.set_bone_map(found)
        return {"FINISHED"}


class MANIPNET_OT_load_bone_map(_OfCharacter, bpy.types.Operator, ImportHelper):  # noqa: N801
    """Read the bones from a JSON file"""

    bl_idname = "manipnet.load_bone_map"
    bl_label = "Load Bone Map"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012  (Blender requires a set)
    filename_ext = ".json"

    def execute(self, context):
        try:
            self.character(context).set_bone_map(read_bone_map(Path(self.filepath)))
        except (OSError, RigError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class MANIPNET_OT_save_bone_map(_OfCharacter, bpy.types.Operator, ExportHelper):  # noqa: N801
    """Write the bones to a JSON file, for other scenes and other programs"""

    bl_idname = "manipnet.save_bone_map"
    bl_label = "Save Bone Map"
    filename_ext = ".json"

    def execute(self, context):
        try:
            write_bone_map(Path(self.filepath), self.character(context).bone_map())
        except OSError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class _OfServer:
    """An operator that sends the server a request."""

    @classmethod
    def poll(cls, context):
        return session.remote is not None

    def send(self, op: str, **fields):
        session.remote.send(op, **fields)
        return {"FINISHED"}


class MANIPNET_OT_record_on_server(_OfServer, bpy.types.Operator):  # noqa: N801  (Blender requires such names)
    """Record a take on the server's machine. Press again to end it"""

    bl_idname = "manipnet.record_on_server"
    bl_label = "Record on Server"

    def execute(self, context):
        if session.remote.state.recording is not None:
            return self.send("stop_recording")
        name = context.scene.manipnet.take_name
        return self.send("record", **({"name": name} if name else {}))


def _objects(_self, _context):
    """The items of a menu with the server's objects; Blender requires that the texts stay in memory."""
    global _items
    names = session.remote.state.objects if session.remote is not None else ()
    _items = [(name, name, "") for name in names] or [("", "No objects", "")]
    return _items


_items: list[tuple[str, str, str]] = []


class MANIPNET_OT_select_object(_OfServer, bpy.types.Operator):  # noqa: N801  (Blender requires such names)
    """Choose the object that this body carries"""

    bl_idname = "manipnet.select_object"
    bl_label = "Object"
    actor: bpy.props.StringProperty(options={"HIDDEN"})
    body: bpy.props.StringProperty(options={"HIDDEN"})
    object: bpy.props.EnumProperty(name="Object", items=_objects)

    def execute(self, context):
        return self.send("select_object", body=self.body, object=self.object, actor=self.actor)


class MANIPNET_OT_rest(_OfServer, bpy.types.Operator):  # noqa: N801  (Blender requires such names)
    """Let the hands of all actors ease to the rest pose"""

    bl_idname = "manipnet.rest"
    bl_label = "Rest"

    def execute(self, context):
        for actor in list(session.remote.state.bodies) or [None]:
            self.send("rest", **({"actor": actor} if actor else {}))
        return {"FINISHED"}


def _make_keyframes(operator, context) -> None:
    """End a running recording by the scene's settings, and report what became of it."""
    if not session.is_recording:
        return
    chosen = context.scene.manipnet
    frames = session.stop_recording(chosen.start_at, chosen.within_scene, chosen.keys_per_second)
    if frames:
        operator.report({"INFO"}, f"Made keyframes for {frames} frames, in new NLA tracks")
    else:
        operator.report({"WARNING"}, "Nothing was recorded: no hands have arrived")


OPERATORS = (
    MANIPNET_OT_connect,
    MANIPNET_OT_disconnect,
    MANIPNET_OT_record,
    MANIPNET_OT_add_character,
    MANIPNET_OT_remove_character,
    MANIPNET_OT_find_bones,
    MANIPNET_OT_load_bone_map,
    MANIPNET_OT_save_bone_map,
    MANIPNET_OT_record_on_server,
    MANIPNET_OT_select_object,
    MANIPNET_OT_rest,
)
