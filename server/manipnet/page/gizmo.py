"""Arrows and rings in the scene of one visitor, with which a prop is moved on its body."""

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
    """The gizmo is a child of the body, so its pose in the scene is the prop's place on the body."""

    def __init__(self, scene: viser.SceneApi, moved: Moved) -> None:
        """Calls `moved` with each new T_body_prop `(7,)`, and whether it ends the drag; one call at a time."""
        self._body = scene.add_frame("/placing", show_axes=False, visible=False)
        self._controls = scene.add_transform_controls("/placing/handles", SIZE_M, depth_test=False, opacity=0.8)
        self._moved, self._dragging, self._calling = moved, False, asyncio.Lock()
        self._controls.on_update(self._dragged)

    def follow(self, T_world_prop: Array | None, offset: Array | None) -> None:
        """Go to a prop that sits at `offset (7,)` on its body; None hides the gizmo."""
        self._body.visible = T_world_prop is not None and offset is not None
        if T_world_prop is None or offset is None:
            return
        body = compose(T_world_prop, invert(offset))
        self._body.position, self._body.wxyz = body[:3], wxyz(body[3:])
        if not self._dragging:
            self._controls.position, self._controls.wxyz = offset[:3], wxyz(offset[3:])

    async def _dragged(self, event: viser.TransformControlsEvent) -> None:
        """Runs on the page's event loop. Moves that arrive while `moved` is running are skipped, except the last."""
        self._dragging = event.phase != "end"
        if event.phase == "start" or (self._dragging and self._calling.locked()):
            return
        async with self._calling:
            await asyncio.to_thread(self._moved, self._offset(), not self._dragging)

    def _offset(self) -> Array:
        w, x, y, z = self._controls.wxyz
        return np.array([*self._controls.position, x, y, z, w])
