"""One recording in progress: a child process writes the file, and a thread feeds it what was published.

The tick thread only leaves behind what it has encoded anyway. The file is whole however the server ends: if the server
is killed, the child notices and closes the file.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final

import msgpack

from manipnet.geometry import Array
from manipnet.runtime.child_process import ChildProcess
from manipnet.synthesis.hand.profile import HandProfile, profile_to_json
from manipnet.telemetry import Telemetry

MAX_WAITING: Final = 7200
"""Messages that wait for a slow disk, two minutes of one actor; beyond it the newest are lost, and counted."""
EVERY_S: Final = 0.05
STOP_S: Final = 20.0
_METADATA: Final = 0
"""In place of the time of a message: what follows is metadata."""

Meshes = Mapping[str, tuple[Array, Any, float]]
"""Vertices `(V, 3)`, faces `(F, 3)` and scale by the name of the prop."""

_log = logging.getLogger(__name__)


def profile_key(name: str) -> str:
    """The key of an avatar's profile in the metadata."""
    return f"hand {name}"


class RecordingFailedError(RuntimeError):
    """A recording could not be written; the text says why."""


class OpenRecording:
    """Records hands messages, those of avatars too, from its construction to `finish`."""

    def __init__(self, path: Path, metadata: Mapping[str, str], meshes: Meshes, telemetry: Telemetry) -> None:
        self.path = path
        self.is_broken = False
        """Whether the child has ended before its time, for the reason in `problem`."""
        self.problem = ""
        self._telemetry = telemetry
        self._begin_s = time.monotonic()
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._profiles: dict[str, HandProfile] = {}
        """The profiles that the recording has, by name, as far as their avatars have been recorded."""
        self._metadata = dict(metadata)
        self._finishing = threading.Event()
        self._child = ChildProcess("recorder", _write, path, dict(metadata), dict(meshes))
        self._thread = threading.Thread(target=self._feed, name="recorder", daemon=True)
        self._thread.start()

    @property
    def seconds(self) -> float:
        """How long it has lasted."""
        return time.monotonic() - self._begin_s

    def note(self, payload: bytes) -> None:
        """Take a hands message as msgpack; returns at once."""
        if len(self._waiting) >= MAX_WAITING:
            self._telemetry.count("recorded", fate="lost")
        else:
            self._waiting.append((time.time_ns(), payload))

    def note_avatar(self, payload: bytes, profile: HandProfile) -> None:
        """Take the hands message of an avatar as msgpack, and its profile if that is new; returns at once."""
        if self._profiles.get(profile.name) is not profile:
            self._profiles[profile.name] = profile
            about = {profile_key(profile.name): profile_to_json(profile)}
            if not about.items() <= self._metadata.items():
                self._metadata |= about
                self._waiting.append((_METADATA, msgpack.packb(about) or b""))
        self.note(payload)

    def finish(self) -> dict[str, int]:
        """Write what waits and close the file; returns the numbers of `hands`, `bodies` and `avatars` in it.

        Raises `RecordingFailedError`.
        """
        self._finishing.set()
        self._thread.join(STOP_S)
        if self.is_broken:
            raise RecordingFailedError(self.problem)
        answer = self._answer()
        if "error" in answer:
            raise RecordingFailedError(f"{self.path.name}: {answer['error']}")
        return answer

    def _answer(self) -> dict[str, Any]:
        """What the child says at its end."""
        answer: dict[str, Any] = {"error": "the process that writes it does not answer"}
        with suppress(EOFError, OSError):
            if self._child.connection.poll(STOP_S):
                answer = msgpack.unpackb(self._child.connection.recv_bytes())
        self._child.close(STOP_S)
        return answer

    def _feed(self) -> None:
        """Send what waits until `finish`, and then all that is left."""
        try:
            while not self._send_waiting():
                self._finishing.wait(EVERY_S)
        except Exception:  # the child has ended, so it has said why
            reason = self._answer().get("error", "its process has ended")
            self.problem = (
                f"{self.path.name} has ended early ({reason}); what was written until then is kept, and "
                f"`manipnet recover {self.path}` repairs it"
            )
            self.is_broken = True
            _log.error("the recording %s; the session goes on", self.problem)

    def _send_waiting(self) -> bool:
        is_last = self._finishing.is_set()  # read first: nothing is left behind after that
        while self._waiting:
            time_ns, payload = self._waiting.popleft()
            self._child.connection.send_bytes(time_ns.to_bytes(8, "little") + payload)
            if time_ns != _METADATA:
                self._telemetry.count("recorded", fate="written")
        if is_last:
            self._child.connection.send_bytes(b"")
        return is_last


def _write(connection: Connection, path: Path, metadata: dict[str, str], meshes: Meshes) -> None:
    """The child: writes until an empty message or the end of the server, then answers what it wrote."""
    from manipnet.recording.mcap_file import RecordingWriter, bodies_of, mesh_file
    from manipnet.wire import decode_msgpack

    counts = {"hands": 0, "bodies": 0, "avatars": 0}
    answer: dict[str, Any] = counts
    try:
        files = {f"{name}.ply": mesh_file(*mesh) for name, mesh in meshes.items()}
        with RecordingWriter(path, metadata, files) as writer, suppress(EOFError):
            first_actor = None
            while content := connection.recv_bytes():
                time_ns = int.from_bytes(content[:8], "little")
                if time_ns == _METADATA:
                    writer.add_about(msgpack.unpackb(content[8:]))
                    continue
                message = decode_msgpack(content[8:])
                first_actor = first_actor or message.actor
                if message.actor == first_actor and message.bodies and message.hand is None:
                    writer.write_bodies(bodies_of(message), time_ns)
                    counts["bodies"] += 1
                writer.write_hands(message, time_ns)
                counts["hands" if message.hand is None else "avatars"] += 1
    except Exception as error:
        why = error.strerror if isinstance(error, OSError) and error.strerror else f"{type(error).__name__}: {error}"
        answer = {"error": why}
    with suppress(OSError):
        connection.send_bytes(msgpack.packb(answer) or b"")
