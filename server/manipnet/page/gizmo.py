"""Arrows and rings on a prop in the scene of one visitor: dragged, they say where its mesh sits on its body."""

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
    """They hang on the body, so where they are on it is where the mesh is to sit."""

    def __init__(self, scene: viser.SceneApi, moved: Moved) -> None:
        """`moved` hears of each new T_body_prop `(7,)`, and whether it is the last one of a drag; one at a time."""
        self._body = scene.add_frame("/placing", show_axes=False, visible=False)
        self._grips = scene.add_transform_controls("/placing/handles", SIZE_M, depth_test=False, opacity=0.8)
        self._moved, self._held, self._telling = moved, False, asyncio.Lock()
        self._grips.on_update(self._dragged)

    def follow(self, T_world_prop: Array | None, offset: Array | None) -> None:
        """Be where a prop is `(7,)` that sits at `offset (7,)` on its body; out of sight without."""
        self._body.visible = T_world_prop is not None and offset is not None
        if T_world_prop is None or offset is None:
            return
        body = compose(T_world_prop, invert(offset))
        self._body.position, self._body.wxyz = body[:3], wxyz(body[3:])
        if not self._held:
            self._grips.position, self._grips.wxyz = offset[:3], wxyz(offset[3:])

    async def _dragged(self, event: viser.TransformControlsEvent) -> None:
        """On the page's event loop, in the order of the hand; what comes while an answer is awaited is left out."""
        self._held = event.phase != "end"
        if event.phase == "start" or (self._held and self._telling.locked()):
            return
        async with self._telling:
            await asyncio.to_thread(self._moved, self._offset(), not self._held)

    def _offset(self) -> Array:
        w, x, y, z = self._grips.wxyz
        return np.array([*self._grips.position, x, y, z, w])
