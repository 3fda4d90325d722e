"""Arrows and rings in the scene of one visitor; dragging them moves the mesh of a prop on its body."""

import asyncio
from collections.abc import Callable
from typing import Final

import numpy as np
import viser

from manipnet.geometry import Array, compose, invert
from manipnet.page.hand_models import wxyz

SIZE_M: Final = 0.16
Moved = Callable[[Array, bool], None]


class Gizmo:
    """The gizmo is attached to the body, so its pose on the body is the offset of the mesh."""

    def __init__(self, scene: viser.SceneApi, moved: Moved) -> None:
        """`moved` is called with each new T_body_prop `(7,)` and whether the drag has ended, one call at a time."""
        self._body = scene.add_frame("/placing", show_axes=False, visible=False)
        self._grips = scene.add_transform_controls("/placing/handles", SIZE_M, depth_test=False, opacity=0.8)
        self._moved, self._held, self._telling = moved, False, asyncio.Lock()
        self._grips.on_update(self._dragged)

    def follow(self, T_world_prop: Array | None, offset: Array | None) -> None:
        """Follow a body's pose `(7,)` with the prop's `offset (7,)` on it; None hides the gizmo."""
        self._body.visible = T_world_prop is not None and offset is not None
        if T_world_prop is None or offset is None:
            return
        body = compose(T_world_prop, invert(offset))
        self._body.position, self._body.wxyz = body[:3], wxyz(body[3:])
        if not self._held:
            self._grips.position, self._grips.wxyz = offset[:3], wxyz(offset[3:])

    async def _dragged(self, event: viser.TransformControlsEvent) -> None:
        """Handle one drag event on the page's event loop; events that arrive while an answer is awaited are skipped."""
        self._held = event.phase != "end"
        if event.phase == "start" or (self._held and self._telling.locked()):
            return
        async with self._telling:
            await asyncio.to_thread(self._moved, self._offset(), not self._held)

    def _offset(self) -> Array:
        w, x, y, z = self._grips.wxyz
        return np.array([*self._grips.position, x, y, z, w])
