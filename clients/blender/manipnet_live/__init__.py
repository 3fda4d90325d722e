"""ManipNet Live for Blender: hands on an armature or as empties, live and as keyframes."""

import bpy

from .panel import CLASSES, Settings
from .session import session


def register() -> None:
    """Register the extension; Blender calls this when the extension is enabled."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.manipnet = bpy.props.PointerProperty(type=Settings)
    bpy.app.handlers.load_pre.append(_stop)


def unregister() -> None:
    """Stop the session and unregister everything; Blender calls this when the extension is disabled."""
    _stop()
    bpy.app.handlers.load_pre.remove(_stop)
    del bpy.types.Scene.manipnet
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)


def _stop(*_: object) -> None:
    session.stop()
