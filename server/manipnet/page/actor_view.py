"""The hands and props of actors in a scene, and the table below them."""

from collections.abc import Mapping
from typing import Final

import numpy as np
import viser

from manipnet.geometry import Array
from manipnet.page.avatar_models import AvatarLook, AvatarModel
from manipnet.page.frames import Frame, ShapeView
from manipnet.page.hand_look import HandLook
from manipnet.page.hand_models import HandModel
from manipnet.page.prop_models import PropModels, lowest_m
from manipnet.page.scenery import Table
from manipnet.wire import HandPose, Side

FLOOR_EVERY: Final = 15
"""The table is checked against the lowest point once in this many frames."""


class ActorView:
    """The hands and props of one actor, under `name`.

    Hands that are not shown any more are hidden and never removed: viser's client 1.1.1 fails when a node with others
    below it is removed.
    """

    def __init__(self, scene: viser.SceneApi, name: str, look: HandLook) -> None:
        self._scene, self._name, self._look = scene, name, look
        self._hands: dict[Side, HandModel] = {}
        self._props = PropModels(scene, f"{name}/props")
        self._avatar: dict[Side, AvatarModel] = {}
        self._avatars: list[tuple[AvatarLook, dict[Side, AvatarModel]]] = []
        """Every avatar that was shown."""
        self._sizes = 0
        """How many models of the model's hand there are, one for each size."""

    def wear(self, look: AvatarLook) -> None:
        """Show the hands of an avatar instead of the model's; an empty look shows the model's again."""
        for model in self._avatar.values():
            model.show(False)
        self._avatar = next((models for known, models in self._avatars if known is look), {})
        if look and not self._avatar:
            name = f"{self._name}/avatar/{len(self._avatars)}"
            self._avatar = {side: AvatarModel(self._scene, f"{name}/{side}", mesh, side) for side, mesh in look.items()}
            self._avatars.append((look, self._avatar))

    def show(
        self, frame: Frame, shapes: Mapping[str, ShapeView], avatar: Mapping[Side, HandPose] | None = None
    ) -> None:
        """Draw one frame, with the hands of its avatar if they are known."""
        hands = frame.message.hands
        for side, model in self._avatar.items():
            model.show(avatar is not None and side in avatar)
            if avatar is not None and side in avatar:
                model.pose(avatar[side])
        for side, hand in hands.items():
            if side not in self._hands or self._hands[side].scale != hand.scale:
                self._make_hand(side, hand.scale)
            self._hands[side].pose(hand)
        for side, model in self._hands.items():
            model.show(side in hands and not self._avatar)
        self._props.show(frame.props, shapes, poses(frame), True)

    def _make_hand(self, side: Side, scale: float) -> None:
        if side in self._hands:
            self._hands[side].show(False)
        self._hands[side] = HandModel(self._scene, f"{self._name}/{side}-{self._sizes}", self._look, side, scale)
        self._sizes += 1


class Stage:
    """The actors of one scene under `name`, with their table."""

    def __init__(self, scene: viser.SceneApi, name: str, look: HandLook) -> None:
        self._scene, self._name, self._look = scene, name, look
        self._root = scene.add_frame(name, show_axes=False)
        self._table = Table(scene, f"{name}/table")
        self._actors: dict[str, ActorView] = {}
        self._frames = 0

    def show(
        self, frame: Frame, shapes: Mapping[str, ShapeView], avatar: Mapping[Side, HandPose] | None = None
    ) -> None:
        """Draw one frame of an actor, with the hands of its avatar if they are known."""
        self._settle(frame, shapes)
        self._actor(frame.message.actor).show(frame, shapes, avatar)

    def wear(self, actor: str, look: AvatarLook) -> None:
        """Show the hands of an avatar for an actor."""
        self._actor(actor).wear(look)

    def _actor(self, actor: str) -> ActorView:
        if actor not in self._actors:
            self._actors[actor] = ActorView(self._scene, f"{self._name}/actors/{actor}", self._look)
        return self._actors[actor]

    def set_visible(self, visible: bool) -> None:
        """Show or hide everything."""
        self._root.visible = visible

    def settle(self) -> None:
        """Put the table below what the next frame shows."""
        self._frames = 0

    def _settle(self, frame: Frame, shapes: Mapping[str, ShapeView]) -> None:
        """Keep the table below everything; the first frame decides where it stands."""
        first, self._frames = self._frames == 0, self._frames + 1
        if not first and self._frames % FLOOR_EVERY:
            return
        places = poses(frame)
        points = [hand.joints[:, :3] for hand in frame.message.hands.values()]
        points += [places[prop.name][None, :3] for prop in frame.props if prop.name in places]
        if not points:
            self._frames = 0
            return
        spread = np.concatenate(points)
        floor_m = min(lowest_m(frame.props, shapes, places), float(spread[:, 1].min()))
        if first:
            self._table.place(spread, floor_m)
        else:
            self._table.lower(floor_m)


def poses(frame: Frame) -> dict[str, Array]:
    """World poses `(7,)` of a frame's tracked bodies, by name."""
    return {body.name: body.pose for body in frame.message.bodies}
