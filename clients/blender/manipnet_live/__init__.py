"""ManipNet Live for Blender: hands on armatures or as empties, props, live and as keyframes."""

import bpy

from .operators import OPERATORS
from .panel import MANIPNET_PT_panel
from .recording import Recording
from .session import session
from .settings import GROUPS, Settings

CLASSES = (*GROUPS, *OPERATORS, MANIPNET_PT_panel)
_kept: list[Recording] = []


@bpy.app.handlers.persistent
def _before_load(*_: object) -> None:
    """End the session, whose objects go with the old file, and keep a running recording for the new one."""
    _kept.extend(filter(None, [session.stop_for_another_file()]))


@bpy.app.handlers.persistent
def _after_load(*_: object) -> None:
    while _kept:
        session.write_kept(_kept.pop())


@bpy.app.handlers.persistent
def _before_save(*_: object) -> None:
    session.release()


def _handlers() -> tuple[tuple[list, object], ...]:
    handlers = bpy.app.handlers
    return ((handlers.load_pre, _before_load), (handlers.load_post, _after_load), (handlers.save_pre, _before_save))


def register() -> None:
    """Register the extension; Blender calls this when the extension is enabled."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.manipnet = bpy.props.PointerProperty(type=Settings)
    for handlers, function in _handlers():
        handlers.append(function)


def unregister() -> None:
    """Stop the session and unregister everything; Blender calls this when the extension is disabled."""
    session.stop()
    for handlers, function in _handlers():
        if function in handlers:
            handlers.remove(function)
    if hasattr(bpy.types.Scene, "manipnet"):
        del bpy.types.Scene.manipnet
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
