"""The live page as the server sees it: an address, and a child process from the first visit on.

Nothing of the page runs in the server: until a browser connects it costs a socket, and then one thread that sends the
newest tick. The process ends with the server, however the server ends. If the process ends, the next visit or a
browser that reconnects starts another one.
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
"""The page receives at most this many ticks per second, always the newest."""
POLL_S: Final = 0.2
"""A stop is noticed within this."""
STOP_S: Final = 3.0
RESTART_S: Final = (0.5, 30.0)
"""The pause before the page is started again; it grows each time the page ends early."""
LASTED_S: Final = 60.0

_log = logging.getLogger(__name__)
Submit = Callable[[list[bytes], Callable[[bytes], object]], None]
"""Handles a request, and passes the answer to the function, on any thread."""


class LivePage:
    """Listens from its creation until `stop`, and serves from `start` on. `see` belongs to the tick thread."""

    def __init__(self, host: str, port: int, submit: Submit, telemetry: Telemetry, hand_file: Path) -> None:
        """Raises `ListenError`. `submit` receives the requests of the page, as it does for any client; `hand_file`
        describes the hand that is shown."""
        self._listener = _listen(host, port)
        self.address = _url(host, self._listener.getsockname()[1])
        self._submit, self._telemetry, self._hand_file = submit, telemetry, hand_file
        self.watched = False
        """Whether a browser is open; only then `see` is worth calling."""
        self._arrived, self._sending = threading.Condition(), threading.Lock()
        self._newest: dict[str, tuple[Frame, Sequence[Shape]]] = {}
        self._avatars: dict[str, HandsMessage] = {}
        """The newest hands of each avatar that were not sent yet."""
        self._shown_hands = frozenset[str]()
        """The names of the avatars that the page shows."""
        self._stopping = threading.Event()
        self._wake, self._woken = socket.socketpair()
        self._thread = threading.Thread(target=self._run, name="page", daemon=True)

    def start(self) -> None:
        """Begin to serve."""
        self._thread.start()

    def see(self, actor: Actor, plan: Plan, message: HandsMessage) -> None:
        """Offer a tick, without computing or copying anything. A tick that was not sent yet is replaced by the next."""
        frame = frame_of(actor, plan.tick, plan.steps, message)
        with self._arrived:
            if message.actor in self._newest:
                self._telemetry.count("page_frames", fate="skipped")
            self._newest[message.actor] = frame, [prop.shape for prop in actor.props]
            self._arrived.notify()

    def wants(self, avatar: str) -> bool:
        """Whether the page shows the hands of an avatar."""
        return self.watched and avatar in self._shown_hands

    def see_avatar(self, message: HandsMessage) -> None:
        """Offer the hands of an avatar, as `see` offers those of its actor."""
        with self._arrived:
            self._avatars[message.hand or ""] = message
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
        while not self._stopping.is_set():
            begin_s = time.monotonic()
            try:
                if self._visited():
                    begin_s = time.monotonic()
                    self._serve()
            except Exception as error:  # the session must continue without a page, until there is one again
                _log.error("the page failed: %s: %s", type(error).__name__, error)
            if self._stopping.is_set():
                return
            self._telemetry.count("page_ended", reason="crash")
            _log.error(
                "the process of the page has ended; the session continues, and the next visit starts the page again"
            )
            pause_s = RESTART_S[0] if time.monotonic() - begin_s > LASTED_S else min(2.0 * pause_s, RESTART_S[1])
            self._stopping.wait(pause_s)

    def _visited(self) -> bool:
        """Wait for a browser; False when the server stops."""
        with selectors.DefaultSelector() as selector:
            selector.register(self._listener, selectors.EVENT_READ)
            selector.register(self._woken, selectors.EVENT_READ)
            selector.select()
        return not self._stopping.is_set()

    def _serve(self) -> None:
        """Run the page's process until it or the server ends."""
        child = ChildProcess("page", _page, self._listener, self._hand_file)
        ours = child.connection
        sender = threading.Thread(target=self._send, args=(ours,), name="page-out", daemon=True)
        try:
            sender.start()
            self._listen_to(ours)
        finally:
            self.watched, self._shown_hands = False, frozenset()
            child.close(STOP_S)
            child.kill()
            with self._arrived:
                self._newest.clear()
                self._avatars.clear()
                self._arrived.notify()
            sender.join()

    def _listen_to(self, ours: Connection) -> None:
        """Receive from the page until it or the server ends: whether it is watched, its requests, and its log."""
        while not self._stopping.is_set():
            try:
                if not ours.poll(POLL_S):
                    continue
                what, content = unpack(ours.recv_bytes())
            except (EOFError, OSError):
                return
            if what == "watched":
                self.watched = content
            elif what == "hands":
                self._shown_hands = frozenset(content)
            elif what == "ask":
                number, request = content

                def reply(answer: bytes, number: int = number) -> None:
                    self._send_message(ours, "answer", (number, answer))

                self._submit([request], reply)
            elif what == "log":
                _log.log(content[0], "%s", content[1])

    def _send(self, ours: Connection) -> None:
        """Send the newest ticks, and each shape before the first tick that refers to it.

        The page forgets a shape when the newest tick of no actor refers to it, so it is sent again if it comes back.
        """
        try:
            self._send_newest(ours)
        except Exception:  # a page that shows nothing more must not look like one that does
            _log.exception("frames cannot be sent to the page, so it starts again")
            ours.close()

    def _send_newest(self, ours: Connection) -> None:
        sent: dict[str, set[str]] = {}
        """The shapes of the newest tick of each actor, which the page has."""
        while not ours.closed:
            with self._arrived:
                if not self._newest:
                    self._arrived.wait(1.0)
                newest, self._newest = list(self._newest.values()), {}
                avatars, self._avatars = list(self._avatars.values()), {}
            begin_s = time.monotonic()
            for message in avatars:
                self._send_message(ours, "avatar", message)
            for frame, shapes in newest:
                for shape in shapes:
                    if not any(shape.content_hash in known for known in sent.values()):
                        mesh = shape.mesh
                        view = ShapeView(shape.name, shape.content_hash, mesh.vertices, mesh.faces)
                        self._send_message(ours, "shape", view)
                sent[frame.message.actor] = {shape.content_hash for shape in shapes}
                self._send_message(ours, "frame", frame)
                self._telemetry.count("page_frames", fate="shown")
            time.sleep(max(begin_s + 1.0 / FRAMES_HZ - time.monotonic(), 0.0))

    def _send_message(self, ours: Connection, what: str, content: Any) -> None:
        message = pack(what, content)
        with self._sending, contextlib.suppress(OSError, ValueError):  # the page has ended, which `_listen_to` notices
            ours.send_bytes(message)


def frame_of(actor: Actor, tick: Tick, steps: Mapping[Side, HandStep], message: HandsMessage) -> Frame:
    """Everything that the page can show of one tick of an actor."""
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
    from manipnet.page.app import serve  # the server itself does not need the libraries of the page

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
