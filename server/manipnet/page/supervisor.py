"""The server's side of the live page: its address, and the process that serves it from the first visit on.

The page costs the server a socket until a browser connects, and then one thread that sends the newest ticks to the
page's process. That process ends with the server, however the server ends. If the process ends first, the next visit or
the browser's reconnecting starts another one.
"""

import contextlib
import logging
import selectors
import socket
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final

from manipnet.actors.actor import Actor
from manipnet.actors.plan import Plan
from manipnet.actors.props import Prop
from manipnet.geometry import Array, Side
from manipnet.net.errors import ListenError
from manipnet.page.frames import Frame, HandView, PropView, ShapeView
from manipnet.page.serialization import pack, unpack
from manipnet.runtime.child_process import ChildProcess
from manipnet.synthesis.objects.shape import Shape
from manipnet.synthesis.synthesizer import HandStep
from manipnet.telemetry import Telemetry
from manipnet.tracking.tick import Tick
from manipnet.wire import HandsMessage

FRAMES_HZ: Final = 30.0
"""At most this many ticks per second are sent to the page, always the newest."""
POLL_S: Final = 0.2
"""Longest time until a stop is noticed."""
STOP_S: Final = 3.0
RESTART_S: Final = (0.5, 30.0)
"""Shortest and longest pause before a page that ended is started again. The pause doubles each time."""
LASTED_S: Final = 60.0
"""After a page that ran for this long, the pause is short again."""

_log = logging.getLogger(__name__)
Answer = Callable[[list[bytes]], bytes]


class LivePage:
    """Listens from its construction until `stop`, and serves from `start`. The tick thread calls `see`."""

    def __init__(self, host: str, port: int, answer: Answer, telemetry: Telemetry, hand_file: Path) -> None:
        """`answer` answers the page's control requests, and `hand_file` describes the hand to show.

        Raises `ListenError`.
        """
        self._listener = _listen(host, port)
        self.address = _url(host, self._listener.getsockname()[1])
        self._answer, self._telemetry, self._hand_file = answer, telemetry, hand_file
        self.watched = False
        """Whether a browser is open. Otherwise `see` need not be called."""
        self._arrived, self._sending = threading.Condition(), threading.Lock()
        self._newest: dict[str, tuple[Frame, Sequence[Shape]]] = {}
        self._stopping = threading.Event()
        self._wake, self._woken = socket.socketpair()
        self._thread = threading.Thread(target=self._run, name="page", daemon=True)

    def start(self) -> None:
        """Begin to serve."""
        self._thread.start()

    def see(self, actor: Actor, plan: Plan, message: HandsMessage) -> None:
        """Offer a tick without computing or copying anything. It replaces the last one, if that was not sent yet."""
        frame = frame_of(actor, plan.tick, plan.steps, message)
        with self._arrived:
            if message.actor in self._newest:
                self._telemetry.count("page_frames", fate="skipped")
            self._newest[message.actor] = frame, [prop.shape for prop in actor.props]
            self._arrived.notify()

    def stop(self) -> None:
        """End the page and free the port."""
        self._stopping.set()
        self._wake.send(b"x")
        if self._thread.is_alive():
            self._thread.join()
        for each in (self._listener, self._wake, self._woken):
            each.close()

    def _run(self) -> None:
        pause_s = RESTART_S[0]
        while self._visited():
            begin_s = time.monotonic()
            try:
                self._serve()
            except Exception as error:  # the session continues without a page
                _log.error("page: %s: %s", type(error).__name__, error)
            if self._stopping.is_set():
                return
            self._telemetry.count("page_ended", reason="crash")
            _log.error("the page's process has ended; the session continues, and the next visit starts the page again")
            pause_s = RESTART_S[0] if time.monotonic() - begin_s > LASTED_S else min(2.0 * pause_s, RESTART_S[1])
            self._stopping.wait(pause_s)

    def _visited(self) -> bool:
        """Wait for a browser; returns False when the server stops."""
        with selectors.DefaultSelector() as selector:
            selector.register(self._listener, selectors.EVENT_READ)
            selector.register(self._woken, selectors.EVENT_READ)
            selector.select()
        return not self._stopping.is_set()

    def _serve(self) -> None:
        """Start the page's process, and serve until it or the server ends."""
        child = ChildProcess("page", _page, self._listener, self._hand_file)
        ours = child.connection
        sender = threading.Thread(target=self._send_frames, args=(ours,), name="page-out", daemon=True)
        try:
            sender.start()
            self._receive(ours)
        finally:
            self.watched = False
            child.close(STOP_S)
            child.kill()
            with self._arrived:
                self._newest.clear()
                self._arrived.notify()
            sender.join()

    def _receive(self, ours: Connection) -> None:
        """Handle the messages of the page's process until it or the server ends."""
        while not self._stopping.is_set():
            try:
                if not ours.poll(POLL_S):
                    continue
                what, content = unpack(ours.recv_bytes())
            except (EOFError, OSError):
                return
            if what == "watched":
                self.watched = content
            elif what == "ask":
                number, request = content
                self._send_message(ours, "answer", (number, self._answer([request])))
            elif what == "log":
                _log.log(content[0], "%s", content[1])

    def _send_frames(self, ours: Connection) -> None:
        """Send the newest ticks, and each shape before the first tick that contains it."""
        sent: set[str] = set()
        while not ours.closed:
            with self._arrived:
                if not self._newest:
                    self._arrived.wait(1.0)
                newest, self._newest = list(self._newest.values()), {}
            begin_s = time.monotonic()
            for frame, shapes in newest:
                for shape in shapes:
                    if shape.content_hash not in sent:
                        sent.add(shape.content_hash)
                        mesh = shape.mesh
                        view = ShapeView(shape.name, shape.content_hash, mesh.vertices, mesh.faces)
                        self._send_message(ours, "shape", view)
                self._send_message(ours, "frame", frame)
                self._telemetry.count("page_frames", fate="shown")
            time.sleep(max(begin_s + 1.0 / FRAMES_HZ - time.monotonic(), 0.0))

    def _send_message(self, ours: Connection, what: str, content: Any) -> None:
        message = pack(what, content)
        with self._sending, contextlib.suppress(OSError, ValueError):  # the process has ended, which `_receive` notices
            ours.send_bytes(message)


def frame_of(actor: Actor, tick: Tick, steps: Mapping[Side, HandStep], message: HandsMessage) -> Frame:
    """Everything that the page shows of one tick of an actor."""
    props = tuple(_prop(prop, actor.offset(prop.name)) for prop in actor.props)
    windows = {name: body.window for name, body in tick.bodies.items()}
    hands: dict[Side, HandView] = {}
    for side, step in steps.items():
        if (prop := actor.hands[side].prop) is not None:
            hands[side] = HandView(prop, step.distances, step.raw_positions)
    return Frame(message, props, windows, hands)


def _prop(prop: Prop, offset: Array) -> PropView:
    return PropView(prop.name, prop.object, prop.shape.content_hash, prop.scale, offset)


def _page(connection: Connection, listener: socket.socket, hand_file: Path) -> None:
    from manipnet.page.app import serve  # the server itself does not need its libraries

    serve(listener, connection, hand_file)


def _listen(host: str, port: int) -> socket.socket:
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        return socket.create_server(address[:2], family=family, backlog=64)
    except OSError as error:
        raise ListenError(
            f"--page-port: cannot listen on {host}:{port}: {error.strerror or error}; "
            "is another program using it? --page-port 0 takes any free port"
        ) from None


def _url(host: str, port: int) -> str:
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"
