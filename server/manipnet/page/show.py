"""The live session in the scene that all visitors share. What a visitor hides or shows instead is his own."""

import logging
import threading
from collections.abc import Callable, Sequence
from typing import Final

import viser

from manipnet.page.actor_view import Stage
from manipnet.page.avatar_models import AvatarLook
from manipnet.page.charts import History
from manipnet.page.frames import Frame, ShapeView
from manipnet.page.framing import Focus, focus_of
from manipnet.page.hand_look import HandLook
from manipnet.page.overlays import LAYERS, ActorOverlays
from manipnet.page.scenery import add_lights
from manipnet.wire import HandsMessage

LIVE: Final = "/live"
"""The node above everything live; a visitor who watches a take hides it for himself."""


class Show:
    """Draws the newest live frame of every actor."""

    def __init__(self, server: viser.ViserServer, look: HandLook, drawn: Callable[[Sequence[Frame]], None]) -> None:
        """`look` is the hand that is drawn; `drawn` is called with the frames of all actors once they are drawn."""
        self.look = look
        self.live: dict[str, Frame] = {}
        """The newest live frame of each actor."""
        self.histories: dict[str, History] = {}
        """Rates and latencies of each actor."""
        self.focus: Focus | None = None
        """What happens live."""
        self._server, self._drawn = server, drawn
        add_lights(server.scene)
        self._stage = Stage(server.scene, LIVE, look)
        self._shapes: dict[str, ShapeView] = {}
        self._avatars: dict[str, str | None] = {}
        """The avatar that is shown for each actor."""
        self._worn: dict[str, HandsMessage] = {}
        """The newest hands of those avatars, by actor."""
        self._layers: dict[int, frozenset[str]] = {}
        self._overlays: dict[str, ActorOverlays] = {}
        self._drawing, self._arrived = threading.Lock(), threading.Event()

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

    def add_avatar(self, message: HandsMessage) -> None:
        """Take the newest hands of an avatar; they are drawn with the next frame of its actor."""
        if self._avatars.get(message.actor) == message.hand:
            self._worn[message.actor] = message

    def show_avatar(self, actor: str, avatar: str | None, look: AvatarLook) -> None:
        """Show the hands of an avatar instead of the model's for an actor, or with None the model's again."""
        with self._drawing, self._server.atomic():
            self._worn.pop(actor, None)
            self._avatars[actor] = avatar
            self._stage.wear(actor, look)

    def want_layers(self, visitor: int, layers: frozenset[str]) -> None:
        """Draw these keys of `overlays.OVERLAYS` for one visitor; the empty set forgets him."""
        self._layers = {**self._layers, visitor: layers}
        if not layers:
            del self._layers[visitor]

    def settle(self) -> None:
        """Move the table to where the hands are, with the next frame."""
        self._stage.settle()

    def _draw_live(self) -> None:
        """Draw the newest frame of every actor, as fast as frames arrive or can be drawn."""
        while self._arrived.wait():
            self._arrived.clear()
            try:
                self._draw(list(self.live.values()))
            except Exception:  # the next frame may be fine
                logging.getLogger(__name__).exception("a frame cannot be drawn")

    def _draw(self, frames: list[Frame]) -> None:
        layers = set[str]().union(*self._layers.values())
        with self._drawing, self._server.atomic():
            for frame in frames:
                actor = frame.message.actor
                if actor not in self._overlays:
                    self._overlays[actor] = ActorOverlays(self._server.scene, LAYERS, actor, self.look)
                worn = self._worn.get(actor)
                self._stage.show(frame, self._shapes, None if worn is None else worn.hands)
                self._overlays[actor].show(frame, self._shapes, layers)
        self.focus = focus_of(frames)
        self._drawn(frames)
