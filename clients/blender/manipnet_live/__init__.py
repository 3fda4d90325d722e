"""ManipNet Live for Blender: fingers on an armature or as empties, live and as keyframes."""

import bpy

from .panel import CLASSES, Settings
from .session import session


def register() -> None:
    """Called by Blender when the extension is enabled."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.manipnet = bpy.props.PointerProperty(type=Settings)
    bpy.app.handlers.load_pre.append(_stop)


def unregister() -> None:
    """Called by Blender when the extension is disabled: no thread and no timer may outlive it."""
    _stop()
    bpy.app.handlers.load_pre.remove(_stop)
    del bpy.types.Scene.manipnet
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)


def _stop(*_: object) -> None:
    session.stop()
