"""The page's own process: receives frames from the server, shows them to browsers and sends requests back."""

import logging
import os
import socket
import sys
import threading
import time
import warnings
from collections.abc import Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final

import viser

from manipnet.page.frames import Frame
from manipnet.page.framing import begin_at_the_table
from manipnet.page.hand_choices import HandChoices, is_avatar
from manipnet.page.hand_look import HandLook, look_of
from manipnet.page.panel import Panel
from manipnet.page.rpc import RefusedError, RpcClient, RpcLog
from manipnet.page.show import Show
from manipnet.page.web_server import OPERATOR, open_server
from manipnet.synthesis.hand.hand_file import read_hand

REFRESH_S: Final = 0.5


def serve(listener: socket.socket, connection: Connection, hand_file: Path) -> None:
    """Serve the page until the server ends, however it ends. `hand_file` describes the hand that is shown."""
    sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 (viser prints there, but it is the server's)
    link = RpcClient(connection)
    logging.basicConfig(level=logging.WARNING, handlers=[RpcLog(link)], force=True)
    logging.getLogger("websockets").setLevel(logging.CRITICAL)  # a visitor who leaves is not worth a log line
    warnings.filterwarnings("ignore", "Queued a ")  # a visitor may leave while something is on its way to him
    page = Page(link, look_of(read_hand(hand_file)))
    page.open(open_server(listener, "ManipNet Live", page.dropped))
    threading.Thread(target=page.refresh, name="refresh", daemon=True).start()
    page.run()
    os._exit(0)  # browsers are still connected, and nothing here has to be saved


class Page:
    """One show for everybody, and a panel for each visitor."""

    def __init__(self, link: RpcClient, look: HandLook) -> None:
        self._link, self._look = link, look
        self._panels: dict[int, Panel] = {}

    def open(self, server: viser.ViserServer) -> None:
        """Set up the scene and let visitors in."""
        self._show = Show(server, self._look, self._follow)
        begin_at_the_table(server.initial_camera)
        self._hands = HandChoices(self._link, self._show)
        server.on_client_connect(self._connected)
        server.on_client_disconnect(self._disconnected)

    def run(self) -> None:
        """Receive frames and shapes until the server ends. Answers arrive here too, so nothing here may block."""
        self._show.start()
        for what, content in self._link.incoming():
            if what == "shape":
                self._show.add_shape(content)
            elif what == "avatar":
                self._show.add_avatar(content)
            elif what == "frame":
                self._show.add_frame(content)

    def dropped(self, name: str, content: bytes, visitor: str) -> str:
        """Import a mesh or an avatar for the actor or body that the visitor has chosen; returns a message for him."""
        operators = {str(number): panel for number, panel in self._panels.items() if panel.objects is not None}
        panel = operators.get(visitor) or next(iter(operators.values()), None)
        if panel is None or panel.objects is None:
            return "only a browser on the server's own machine may import files, and none is open"
        try:
            if is_avatar(name, content):
                return panel.wear(name, content)
            return panel.objects.import_mesh(name, content)
        except (RefusedError, ValueError, OSError) as error:
            return str(error)

    def refresh(self) -> None:
        """Update all panels every `REFRESH_S` seconds."""
        while True:
            begin_s = time.monotonic()
            for panel in list(self._panels.values()):
                try:
                    panel.refresh()
                except Exception:  # a visitor who has just left, or a bug: the other panels must still be updated
                    logging.getLogger(__name__).exception("a panel cannot be refreshed")
            time.sleep(max(REFRESH_S - (time.monotonic() - begin_s), 0.1))

    def _follow(self, frames: Sequence[Frame]) -> None:
        for panel in list(self._panels.values()):
            panel.follow(frames)

    async def _connected(self, client: viser.ClientHandle) -> None:
        self._panels[client.client_id] = Panel(self._link.ask, self._show, self._hands, client, OPERATOR.get())
        self._link.watch(True)

    async def _disconnected(self, client: viser.ClientHandle) -> None:
        panel = self._panels.pop(client.client_id, None)
        if panel is not None:
            panel.close()
        self._link.watch(bool(self._panels))
