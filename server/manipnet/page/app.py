"""The page's own process: from what the server hands over to what browsers show, and back."""

import logging
import os
import signal
import socket
import sys
import threading
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final

import numpy as np
import viser

from manipnet.geometry import Array
from manipnet.page.charts import History
from manipnet.page.frames import Frame, ShapeView
from manipnet.page.hand_models import HandModel
from manipnet.page.overlays import ActorOverlays
from manipnet.page.panel import Panel
from manipnet.page.playback import Recording
from manipnet.page.prop_models import PropModels, lowest_m
from manipnet.page.rpc import RefusedError, RpcClient, RpcLog
from manipnet.page.scenery import Scenery
from manipnet.page.web_server import OPERATOR, open_server
from manipnet.synthesis.hand.hand import Hand
from manipnet.synthesis.hand.hand_file import read_hand
from manipnet.wire import Side

REFRESH_S: Final = 0.5
NICE: Final = 10
"""Whatever is shown here can wait for the ticks, also on a machine that has no processor to spare."""
FLOOR_EVERY: Final = 15
"""Frames between two looks at what is lowest."""


def serve(listener: socket.socket, connection: Connection, hand_file: Path) -> None:
    """Serve the page until the server ends, whatever way it ends. `hand_file` describes the hand that is shown."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a Ctrl-C is for the server, which then ends this
    if hasattr(os, "nice"):
        os.nice(NICE)
    sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 (viser greets there; it belongs to the server)
    link = RpcClient(connection)
    logging.basicConfig(level=logging.WARNING, handlers=[RpcLog(link)], force=True)
    logging.getLogger("websockets").setLevel(logging.CRITICAL)  # visitors that go away are no news
    page = Page(link, read_hand(hand_file))
    page.open(open_server(listener, "ManipNet Live", page.dropped))
    threading.Thread(target=page.refresh, name="refresh", daemon=True).start()
    page.run()
    os._exit(0)  # browsers are still connected; nothing here is worth saving


class ActorView:
    """One actor in the scene."""

    def __init__(self, scene: viser.SceneApi, name: str, hand: Hand) -> None:
        self._scene, self._name, self._hand = scene, f"/{name}", hand
        self._hands: dict[Side, HandModel] = {}
        self._props = PropModels(scene, f"/{name}/props")
        self._layers = ActorOverlays(scene, f"/{name}/layers", hand)

    def show(self, frame: Frame, shapes: dict[str, ShapeView], layers: set[str]) -> None:
        """One tick."""
        hands = frame.message.hands
        for side, hand in hands.items():
            if side not in self._hands or self._hands[side].scale != hand.scale:
                self._hands[side] = HandModel(self._scene, f"{self._name}/{side}", self._hand, side, hand.scale)
            self._hands[side].pose(hand)
        for side, model in self._hands.items():
            model.show(side in hands)
        self._props.show(frame.props, shapes, poses(frame), True)
        self._layers.show(frame, shapes, layers)


class Page:
    """What is shown to everybody, and a panel for each visitor."""

    def __init__(self, link: RpcClient, hand: Hand) -> None:
        self.link, self._hand = link, hand
        self.layers: set[str] = set()
        """Those of `layers.OVERLAYS` that are shown."""
        self.histories: dict[str, History] = {}
        """By actor."""
        self.recording: Recording | None = None
        """What is shown instead of what is live."""
        self.live: dict[str, Frame] = {}
        """The newest frame of each actor."""
        self._shapes: dict[str, ShapeView] = {}
        self._views: dict[str, ActorView] = {}
        self._drawing, self._news = threading.Lock(), threading.Event()
        self._drawn = 0
        self._panels: dict[int, Panel] = {}

    def open(self, server: viser.ViserServer) -> None:
        """Furnish the stage and let visitors in."""
        self._server, self._scenery = server, Scenery(server.scene)
        server.gui.configure_theme(
            dark_mode=True, show_logo=False, show_share_button=False, brand_color=(88, 166, 255), control_width="medium"
        )
        server.on_client_connect(self._came)
        server.on_client_disconnect(self._left)

    def run(self) -> None:
        """Take what comes until the server ends. Nothing here takes long: answers come the same way."""
        threading.Thread(target=self._draw, name="draw", daemon=True).start()
        for what, content in self.link.incoming():
            if what == "shape":
                self._shapes[content.content_hash] = content
            elif what == "frame":
                actor = content.message.actor
                self.live[actor] = content
                self.histories.setdefault(actor, History()).note(content.message)
                self._news.set()

    def show(self, frame: Frame, shapes: dict[str, ShapeView] | None = None) -> None:
        """Draw one tick."""
        shapes = self._shapes if shapes is None else shapes
        name = frame.message.actor
        with self._drawing, self._server.atomic():
            self._settle(frame, shapes)
            if name not in self._views:
                self._views[name] = ActorView(self._server.scene, name, self._hand)
            self._views[name].show(frame, shapes, self.layers)
            for panel in list(self._panels.values()):
                panel.follow(None if self.recording is not None else frame)

    def play(self, recording: Recording | None) -> None:
        """Show a recording instead of what is live, or what is live again."""
        with self._drawing:
            self.recording = recording
            self._drawn = 0
        if recording is not None:
            self.show(recording.at(0.0), recording.shapes)

    def look(self, camera: viser.CameraHandle) -> None:
        """Let a camera see the hands."""
        self._scenery.look(camera)

    def recenter(self) -> None:
        """Put table and cameras where the hands are now."""
        self._drawn = 0

    def dropped(self, name: str, content: bytes) -> str:
        """Bring in a file that was dropped on the page; what became of it."""
        panel = next((panel for panel in self._panels.values() if panel.objects is not None), None)
        if panel is None or panel.objects is None:
            return "nobody is here who may bring in files"
        try:
            return panel.objects.bring_in(name, content)
        except (RefusedError, ValueError, OSError) as error:
            return str(error)

    def refresh(self) -> None:
        """Bring the panels up to date, again and again."""
        while True:
            begin_s = time.monotonic()
            for panel in list(self._panels.values()):
                try:
                    panel.refresh()
                except Exception:  # a visitor who just left, or a fault of ours: the others want to see something
                    logging.getLogger(__name__).exception("a panel cannot be refreshed")
            time.sleep(max(REFRESH_S - (time.monotonic() - begin_s), 0.1))

    def _draw(self) -> None:
        """Draw the newest tick of every actor, as fast as they come or as they can be drawn."""
        while self._news.wait():
            self._news.clear()
            for frame in list(self.live.values()) if self.recording is None else ():
                try:
                    self.show(frame)
                except Exception:  # one tick is not drawn
                    logging.getLogger(__name__).exception("a tick cannot be drawn")

    def _settle(self, frame: Frame, shapes: dict[str, ShapeView]) -> None:
        """Keep the table below everything; at first, and when asked, put it where things are."""
        first, self._drawn = self._drawn == 0, self._drawn + 1
        if not first and self._drawn % FLOOR_EVERY:
            return
        places = poses(frame)
        points = [hand.joints[:, :3] for hand in frame.message.hands.values()]
        points += [places[prop.name][None, :3] for prop in frame.props if prop.name in places]
        if not points:
            self._drawn = 0
            return
        spread = np.concatenate(points)
        floor_m = min(lowest_m(frame.props, shapes, places), float(spread[:, 1].min()))
        if not first:
            self._scenery.lower(floor_m)
            return
        self._scenery.place(spread, floor_m)
        for client in self._server.get_clients().values():
            self._scenery.look(client.camera)

    async def _came(self, client: viser.ClientHandle) -> None:
        self._panels[client.client_id] = Panel(self, client, OPERATOR.get())
        self.link.watch(True)
        if self._scenery.placed:
            self._scenery.look(client.camera)

    async def _left(self, client: viser.ClientHandle) -> None:
        self._panels.pop(client.client_id, None)
        self.link.watch(bool(self._panels))


def poses(frame: Frame) -> dict[str, Array]:
    """Where the tracked bodies of a frame are, `(7,)` by name."""
    return {body.name: body.pose for body in frame.message.bodies}
