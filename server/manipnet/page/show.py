"""What every visitor sees: the live hands or a recording, drawn into one scene."""

import logging
import threading
from collections.abc import Callable
from typing import Final

import numpy as np
import viser

from manipnet.geometry import Array
from manipnet.page.charts import History
from manipnet.page.frames import Frame, ShapeView
from manipnet.page.hand_models import HandModel
from manipnet.page.overlays import ActorOverlays
from manipnet.page.playback import Recording
from manipnet.page.prop_models import PropModels, lowest_m
from manipnet.page.scenery import Scenery
from manipnet.synthesis.hand.hand import Hand
from manipnet.wire import Side

FLOOR_EVERY: Final = 15
"""The table is checked against the lowest point once in this many frames."""


class Show:
    """Draws frames of the live session, or of a recording while one is open."""

    def __init__(self, server: viser.ViserServer, hand: Hand, drawn: Callable[[Frame | None], None]) -> None:
        """`hand` is the one that is drawn.

        `drawn` is called with every live frame that was drawn, and with None for a frame of a recording.
        """
        self.overlays: set[str] = set()
        """Keys of `overlays.OVERLAYS` that are visible."""
        self.live: dict[str, Frame] = {}
        """The newest live frame of each actor."""
        self.histories: dict[str, History] = {}
        """Rates and latencies of each actor."""
        self.recording: Recording | None = None
        """The recording that is shown instead of the live session."""
        self._server, self._hand, self._drawn = server, hand, drawn
        self._scenery = Scenery(server.scene)
        self._shapes: dict[str, ShapeView] = {}
        self._views: dict[str, ActorView] = {}
        self._drawing, self._arrived = threading.Lock(), threading.Event()
        self._frames = 0

    def start(self) -> None:
        """Begin to draw live frames, in a thread."""
        threading.Thread(target=self._draw_live, name="draw", daemon=True).start()

    def add_shape(self, shape: ShapeView) -> None:
        """Remember a shape that the next live frame refers to by its hash."""
        self._shapes = {**self._shapes, shape.content_hash: shape}

    def add_frame(self, frame: Frame) -> None:
        """Take a live frame; it is drawn unless a newer one of the same actor arrives first.

        Shapes that the newest frame of no actor refers to are forgotten.
        """
        actor = frame.message.actor
        self.live[actor] = frame
        used = {prop.content_hash for each in self.live.values() for prop in each.props}
        if not used.issuperset(self._shapes):
            self._shapes = {name: shape for name, shape in self._shapes.items() if name in used}
        self.histories.setdefault(actor, History()).note(frame.message)
        self._arrived.set()

    def set_overlay(self, name: str, visible: bool) -> None:
        """Show or hide one of `overlays.OVERLAYS`."""
        self.overlays = self.overlays | {name} if visible else self.overlays - {name}

    def play(self, recording: Recording | None) -> None:
        """Show the beginning of a recording, or the live session again."""
        with self._drawing:
            self.recording = recording
            self._frames = 0
        self.seek(0.0)

    def seek(self, second: float) -> None:
        """Draw the open recording at this many seconds from its beginning."""
        if (recording := self.recording) is not None:
            self._draw(recording.at(second), recording.shapes)

    def frame_hands(self, camera: viser.CameraHandle) -> None:
        """Point a camera at the hands, once something has been drawn."""
        if self._scenery.placed:
            self._scenery.look(camera)

    def recenter(self) -> None:
        """Move the table and every camera to where the hands are, with the next frame."""
        self._frames = 0

    def _draw_live(self) -> None:
        """Draw the newest frame of every actor, as fast as frames arrive or can be drawn."""
        while self._arrived.wait():
            self._arrived.clear()
            for frame in list(self.live.values()) if self.recording is None else ():
                try:
                    self._draw(frame, self._shapes)
                except Exception:  # the next frame may be fine
                    logging.getLogger(__name__).exception("a frame cannot be drawn")

    def _draw(self, frame: Frame, shapes: dict[str, ShapeView]) -> None:
        name = frame.message.actor
        with self._drawing, self._server.atomic():
            self._settle(frame, shapes)
            if name not in self._views:
                self._views[name] = ActorView(self._server.scene, name, self._hand)
            self._views[name].show(frame, shapes, self.overlays)
            self._drawn(None if self.recording is not None else frame)

    def _settle(self, frame: Frame, shapes: dict[str, ShapeView]) -> None:
        """Keep the table below everything; the first frame decides where the table stands and cameras look."""
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
        if not first:
            self._scenery.lower(floor_m)
            return
        self._scenery.place(spread, floor_m)
        for client in self._server.get_clients().values():
            self._scenery.look(client.camera)


class ActorView:
    """The hands, props and overlays of one actor in the scene."""

    def __init__(self, scene: viser.SceneApi, name: str, hand: Hand) -> None:
        self._scene, self._name, self._hand = scene, f"/{name}", hand
        self._hands: dict[Side, HandModel] = {}
        self._props = PropModels(scene, f"/{name}/props")
        self._overlays = ActorOverlays(scene, f"/{name}/layers", hand)

    def show(self, frame: Frame, shapes: dict[str, ShapeView], overlays: set[str]) -> None:
        """Draw one frame with the given overlays."""
        hands = frame.message.hands
        for side, hand in hands.items():
            if side not in self._hands or self._hands[side].scale != hand.scale:
                self._hands[side] = HandModel(self._scene, f"{self._name}/{side}", self._hand, side, hand.scale)
            self._hands[side].pose(hand)
        for side, model in self._hands.items():
            model.show(side in hands)
        self._props.show(frame.props, shapes, poses(frame), True)
        self._overlays.show(frame, shapes, overlays)


def poses(frame: Frame) -> dict[str, Array]:
    """World poses `(7,)` of a frame's tracked bodies, by name."""
    return {body.name: body.pose for body in frame.message.bodies}
