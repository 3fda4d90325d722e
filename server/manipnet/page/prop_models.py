"""The objects in the scene: the mesh of each prop at the pose of its body."""

from collections.abc import Mapping
from typing import Final

import numpy as np
import viser

from manipnet.geometry import Array, transform
from manipnet.page.creases import split_at_creases
from manipnet.page.frames import PropView, ShapeView
from manipnet.page.hand_models import GHOST, wxyz

COLORS: Final = ((72, 132, 190), (222, 158, 62), (92, 166, 118), (190, 96, 110), (140, 116, 196), (88, 172, 180))


class PropModels:
    """The props of one actor under `name`; a prop is replaced when its shape or size changes."""

    def __init__(self, scene: viser.SceneApi, name: str, ghost: bool = False) -> None:
        self._scene, self._name, self._ghost = scene, name, ghost
        self._models: dict[str, tuple[PropView, viser.MeshHandle]] = {}

    def show(
        self, props: tuple[PropView, ...], shapes: Mapping[str, ShapeView], poses: Mapping[str, Array], visible: bool
    ) -> None:
        """Draw every prop whose shape and pose `(7,)` are known, and hide the others."""
        shown = {prop.name: prop for prop in props if visible and prop.name in poses and prop.content_hash in shapes}
        for name in self._models.keys() - shown.keys():
            self._models.pop(name)[1].remove()
        for order, (name, prop) in enumerate(shown.items()):
            model = self._model(prop, shapes[prop.content_hash], COLORS[order % len(COLORS)])
            model.position, model.wxyz = poses[name][:3], wxyz(poses[name][3:])

    def _model(self, prop: PropView, shape: ShapeView, color: tuple[int, int, int]) -> viser.MeshHandle:
        known = self._models.get(prop.name)
        if known is not None:
            last, model = known
            if (last.content_hash, last.scale) == (prop.content_hash, prop.scale):
                return model
            model.remove()
        vertices, faces = split_at_creases(shape.vertices, shape.faces)
        model = self._scene.add_mesh_simple(
            f"{self._name}/{prop.name}",
            prop.scale * vertices,
            faces,
            color=GHOST if self._ghost else color,
            opacity=0.18 if self._ghost else None,
            cast_shadow=not self._ghost,
            receive_shadow=not self._ghost,
        )
        self._models[prop.name] = prop, model
        return model


def lowest_m(props: tuple[PropView, ...], shapes: Mapping[str, ShapeView], poses: Mapping[str, Array]) -> float:
    """Height of the lowest point of all props, metres; infinite if there is none."""
    heights = [np.inf]
    for prop in props:
        if prop.name in poses and prop.content_hash in shapes:
            vertices = prop.scale * shapes[prop.content_hash].vertices
            heights.append(float(transform(poses[prop.name], vertices)[:, 1].min()))
    return min(heights)
