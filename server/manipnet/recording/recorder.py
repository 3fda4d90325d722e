"""The requests `record`, `stop_recording` and `recordings`: one recording at a time, in the folder of the takes."""

import json
import shutil
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from manipnet.actors.props import Prop
from manipnet.common.file_names import is_device, is_encodable
from manipnet.control.request import Handler, Request, RequestError
from manipnet.recording.open_recording import OpenRecording, RecordingFailedError
from manipnet.recording.take_names import NAME, free_path, safe_name, time_name
from manipnet.synthesis.hand.profile import HandProfile
from manipnet.telemetry import Telemetry

MIN_FREE_BYTES: Final = 64 << 20
"""Space for a recording to begin: about a minute of one actor."""

About = Callable[[], tuple[dict[str, str], Sequence[Prop]]]
"""What a recording depends on: its metadata, and the props whose meshes it keeps."""


class Recorder:
    """Records in `folder`. `note` and `note_avatar` belong to the tick thread, the requests to the control thread."""

    def __init__(self, folder: Path, about: About, telemetry: Telemetry) -> None:
        self._folder, self._about, self._telemetry = folder, about, telemetry
        self._open: OpenRecording | None = None
        self._lock = threading.Lock()
        self.finished: list[str] = []
        """The file names of the recordings that were finished in this session."""

    def note(self, payload: bytes) -> None:
        """Record a hands message, given as msgpack, if a recording is in progress; returns at once."""
        recording = self.current()
        if recording is not None:
            recording.note(payload)

    def note_avatar(self, payload: bytes, profile: HandProfile) -> None:
        """Record the hands message of an avatar, given as msgpack, if a recording is in progress; returns at once."""
        recording = self.current()
        if recording is not None:
            recording.note_avatar(payload, profile)

    @property
    def is_recording(self) -> bool:
        """Whether a recording is in progress. From any thread."""
        return self.current() is not None

    def handlers(self) -> Mapping[str, Handler]:
        """One function per operation."""
        return {"record": self._record, "stop_recording": self._stop_recording, "recordings": self._recordings}

    def stop(self) -> None:
        """Finish the recording in progress, if any."""
        with suppress(RequestError):
            self._stop_recording({})

    @property
    def folder(self) -> Path:
        """The folder of the recordings."""
        return self._folder.resolve()

    def current(self) -> OpenRecording | None:
        """The recording in progress. From any thread."""
        recording = self._open
        return None if recording is None or recording.is_broken else recording

    def begin(self, name: str, about: Mapping[str, str]) -> Path:
        """Begin a recording under a name that resembles the given one, and return its file.

        `about` is added to its metadata. Raises `RequestError`.
        """
        with self._lock:
            self._check_free()
            self._check_space()
            path = free_path(self._folder, safe_name(name, self._folder))
            self._open = self._begin(path, about)
        return path

    def finish(self) -> dict[str, Any]:
        """End the recording in progress. Raises `RequestError`."""
        return self._stop_recording({})

    def _record(self, request: Request) -> dict[str, Any]:
        path = recording_path(self._folder, request.get("name", time_name()))
        with self._lock:
            self._check_free()
            self._check_space()
            if path.exists():
                raise RequestError(f"{path.name} already exists; give another name")
            self._open = self._begin(path)
        return {"name": path.name, "folder": str(self._folder.resolve())}

    def _check_free(self) -> None:
        """Raise `RequestError` while something is being recorded."""
        if (recording := self.current()) is not None:
            raise RequestError(f"{recording.path.name} is being recorded; end it with stop_recording first")

    def _check_space(self) -> None:
        """Raise `RequestError` if the disk is full: a recording that has begun could only be cut off."""
        folder = next((folder for folder in (self._folder, *self._folder.resolve().parents) if folder.is_dir()), None)
        free = MIN_FREE_BYTES if folder is None else shutil.disk_usage(folder).free
        if free < MIN_FREE_BYTES:
            raise RequestError(
                f"the disk of {self._folder.resolve()} has only {free >> 20} MB left, and a recording needs "
                f"{MIN_FREE_BYTES >> 20} MB to begin; make room, or start the server with --takes on another disk"
            )

    def _begin(self, path: Path, more: Mapping[str, str] | None = None) -> OpenRecording:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RequestError(
                f"the folder {path.parent} cannot be created ({error.strerror}); start the server with --takes FOLDER"
            ) from None
        metadata, props = self._about()
        meshes = {prop.name: (prop.shape.mesh.vertices, prop.shape.mesh.faces, prop.scale) for prop in props}
        metadata = {**metadata, **(more or {})}
        return OpenRecording(path, metadata, meshes, self._telemetry)

    def _stop_recording(self, _: Request) -> dict[str, Any]:
        with self._lock:
            recording, self._open = self._open, None
            if recording is None:
                raise RequestError("nothing is being recorded; begin with record")
            try:
                counts = recording.finish()
            except RecordingFailedError as error:
                raise RequestError(str(error)) from None
            self.finished.append(recording.path.name)
        return {"name": recording.path.name, "seconds": recording.seconds, **counts}

    def _recordings(self, _: Request) -> dict[str, Any]:
        recording = self.current()
        files = sorted(self._folder.glob("*.mcap"), key=_changed_s, reverse=True)
        return {
            "folder": str(self._folder.resolve()),
            "recordings": [path.name for path in files],
            "recording": None if recording is None else {"name": recording.path.name, "seconds": recording.seconds},
        }


def recording_path(folder: Path, name: Any) -> Path:
    """The file of a take in `folder`. Raises `RequestError` for a name that is not allowed on some system."""
    if not isinstance(name, str) or not NAME.fullmatch(name):
        raise RequestError(
            f"name is {name!r:.60}; allowed are 1 to 64 letters, digits, spaces, dots, _ and -, "
            "not beginning or ending with a space or dot"
        )
    if is_device(name):
        raise RequestError(f"name is {name!r}, which stands for a device on Windows; give another name")
    path = folder / (name.removesuffix(".mcap") + ".mcap")
    if not is_encodable(path):
        raise RequestError(
            f"name is {name!r}, which this system cannot write in its encoding ({sys.getfilesystemencoding()}); "
            "use ASCII letters, or start the server with PYTHONUTF8=1"
        )
    return path


def _changed_s(path: Path) -> float:
    """When a file was changed last; 0 if it has just been deleted, or is a link to nowhere."""
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


def carried_objects(props: Sequence[Prop]) -> str:
    """Which body carries which object at which scale, as JSON for a recording's metadata."""
    return json.dumps({prop.name: {"object": prop.object, "scale": prop.scale} for prop in props})
