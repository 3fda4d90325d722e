"""Recordings made on request, by a process of its own: the tick thread only leaves behind what it has encoded anyway.

The file is whole however the server ends: what it is killed with, the process notices and closes the file.
"""

import json
import logging
import multiprocessing
import re
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final

import msgpack

from manipnet.actors.props import Prop
from manipnet.control.request import Handler, Request, RequestError
from manipnet.geometry import Array
from manipnet.telemetry import Telemetry

MAX_WAITING: Final = 7200
"""Messages kept for a disk that is slow, two minutes of one actor; then the newest are lost, and counted."""
EVERY_S: Final = 0.05
STOP_S: Final = 20.0
NAME: Final = re.compile(r"[\w][\w .-]{0,63}")

_log = logging.getLogger(__name__)
About = Callable[[], tuple[dict[str, str], Sequence[Prop]]]
Meshes = Mapping[str, tuple[Array, Any, float]]


@dataclass(eq=False)
class Take:
    """A recording that is being made."""

    path: Path
    begin_s: float
    process: Any
    connection: Connection
    ended: threading.Event = field(default_factory=threading.Event)
    thread: threading.Thread | None = None


class Recorder:
    """Makes one recording at a time in `folder`. `note` belongs to the tick thread, the rest to the control thread."""

    def __init__(self, folder: Path, about: About, telemetry: Telemetry) -> None:
        """`about` tells what a recording depends on: its metadata, and the props whose meshes it keeps."""
        self._folder, self._about, self._telemetry = folder, about, telemetry
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._take: Take | None = None
        self._lock = threading.Lock()

    def note(self, payload: bytes) -> None:
        """Take a hands message as msgpack; returns at once."""
        if self._take is None:
            return
        if len(self._waiting) >= MAX_WAITING:
            self._telemetry.count("recorded", fate="lost")
            return
        self._waiting.append((time.time_ns(), payload))

    def handlers(self) -> Mapping[str, Handler]:
        """One function per operation."""
        return {"record": self._record, "stop_recording": self._stop, "recordings": self._recordings}

    def stop(self) -> None:
        """Finish what is being recorded, if anything."""
        with suppress(RequestError):
            self._stop({})

    def _record(self, request: Request) -> dict[str, Any]:
        name = request.get("name", time.strftime("take %Y-%m-%d %H.%M.%S"))
        if not isinstance(name, str) or not NAME.fullmatch(name):
            raise RequestError(f"name is {name!r:.60}; allowed are 1 to 64 letters, digits, spaces, dots, _ and -")
        path = self._folder / (name.removesuffix(".mcap") + ".mcap")
        with self._lock:
            if self._take is not None:
                raise RequestError(f"{self._take.path.name} is being recorded; stop_recording ends it")
            if path.exists():
                raise RequestError(f"{path.name} is there already; give another name")
            self._take = self._begin(path)
        return {"name": path.name, "folder": str(self._folder.resolve())}

    def _begin(self, path: Path) -> Take:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RequestError(f"{path.parent} cannot be made ({error.strerror}); start with --takes FOLDER") from None
        metadata, props = self._about()
        meshes = {prop.name: (prop.shape.mesh.vertices, prop.shape.mesh.faces, prop.scale) for prop in props}
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(target=_write, args=(theirs, path, metadata, meshes), name="recorder", daemon=True)
        process.start()
        theirs.close()
        self._waiting.clear()
        take = Take(path, time.monotonic(), process, ours)
        take.thread = threading.Thread(target=self._feed, args=(take,), name="recorder", daemon=True)
        take.thread.start()
        return take

    def _stop(self, _: Request) -> dict[str, Any]:
        with self._lock:
            take, self._take = self._take, None
            if take is None or take.thread is None:
                raise RequestError("nothing is being recorded; record begins")
            take.ended.set()
            take.thread.join(STOP_S)
            told = {"error": "its process does not answer"}
            if take.connection.poll(STOP_S):
                told = msgpack.unpackb(take.connection.recv_bytes())
            take.connection.close()
            take.process.join(STOP_S)
        if "error" in told:
            raise RequestError(f"{take.path.name}: {told['error']}")
        return {"name": take.path.name, "seconds": time.monotonic() - take.begin_s, **told}

    def _recordings(self, _: Request) -> dict[str, Any]:
        take = self._take
        files = sorted(self._folder.glob("*.mcap"), key=lambda path: path.stat().st_mtime, reverse=True)
        return {
            "folder": str(self._folder.resolve()),
            "recordings": [path.name for path in files],
            "recording": take and {"name": take.path.name, "seconds": time.monotonic() - take.begin_s},
        }

    def _feed(self, take: Take) -> None:
        """Hand over what waits until the take has ended, and all of it then."""
        try:
            while not self._hand_over(take):
                take.ended.wait(EVERY_S)
        except OSError:
            self._take = None
            _log.error("the recording %s cannot be written any more; the session goes on", take.path.name)

    def _hand_over(self, take: Take) -> bool:
        ended = take.ended.is_set()  # asked first: nothing is left behind after that
        while self._waiting:
            time_ns, payload = self._waiting.popleft()
            take.connection.send_bytes(time_ns.to_bytes(8, "little") + payload)
            self._telemetry.count("recorded", fate="written")
        if ended:
            take.connection.send_bytes(b"")
        return ended


def _write(connection: Connection, path: Path, metadata: dict[str, str], meshes: Meshes) -> None:
    """The process: writes until it is told to stop, or nobody is there any more."""
    from manipnet.recording.mcap_file import RecordingWriter, bodies_of, mesh_file
    from manipnet.wire import decode_msgpack

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a Ctrl-C is for the server, which then ends this
    counts = {"hands": 0, "bodies": 0}
    try:
        files = {f"{name}.ply": mesh_file(*mesh) for name, mesh in meshes.items()}
        with RecordingWriter(path, metadata, files) as writer, suppress(EOFError):
            actor = None
            while content := connection.recv_bytes():
                message, time_ns = decode_msgpack(content[8:]), int.from_bytes(content[:8], "little")
                actor = actor or message.actor
                if message.actor == actor and message.bodies:
                    writer.write_bodies(bodies_of(message), time_ns)
                    counts["bodies"] += 1
                writer.write_hands(message, time_ns)
                counts["hands"] += 1
        told: dict[str, Any] = counts
    except Exception as error:
        told = {"error": f"{type(error).__name__}: {error}"}
    with suppress(OSError):
        connection.send_bytes(msgpack.packb(told) or b"")


def carried(props: Sequence[Prop]) -> str:
    """Which body carries what, as a recording's metadata says it."""
    return json.dumps({prop.name: {"object": prop.object, "scale": prop.scale} for prop in props})
