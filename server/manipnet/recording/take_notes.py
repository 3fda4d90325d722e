"""What people say about a take: slate, number and note, in a JSON file beside the recording, and requests about them.

`NAME.mcap` is what was recorded and never changes; `NAME.json` holds `slate`, `number` and `note`, as far as they are
known.
"""

import json
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from manipnet.common.atomic_file import replacing
from manipnet.control.request import Handler, Request, RequestError, flag, quoted
from manipnet.recording.recorder import Recorder, recording_path

MAX_SLATE: Final = 40
MAX_NOTE: Final = 2000
MAX_NUMBER: Final = 9999
SUFFIX: Final = ".json"
_KEYS: Final = ("slate", "number", "note")


class TakeNotes:
    """Requests about the takes in `folder`; `recorder` records there. Handlers run on one control thread."""

    def __init__(self, folder: Path, recorder: Recorder) -> None:
        self._folder, self._recorder = folder, recorder.handlers()

    def handlers(self) -> Mapping[str, Handler]:
        """One function per operation; those of the recorder also know about notes."""
        return {
            "record": self._record,
            "recordings": self._recordings,
            "edit_recording": self._edit,
            "delete_recording": self._delete,
        }

    def _record(self, request: Request) -> dict[str, Any]:
        about = _about(request)
        if "name" not in request and about.get("slate"):
            request = {**request, "name": take_name(about["slate"], about.get("number"))}
        answer = self._recorder["record"](request)
        if about:
            write_notes(self._folder / answer["name"], about)
        return answer

    def _recordings(self, request: Request) -> dict[str, Any]:
        answer = self._recorder["recordings"](request)
        if not flag(request, "notes", False):
            return answer
        takes = [self._described(name) for name in answer["recordings"]]
        return {**answer, "takes": [take for take in takes if take is not None]}

    def _described(self, name: str) -> dict[str, Any] | None:
        path = self._folder / name
        try:
            found = path.stat()
        except OSError:  # it was deleted meanwhile
            return None
        return {"name": name, "bytes": found.st_size, "changed_s": found.st_mtime, **read_notes(path)}

    def _edit(self, request: Request) -> dict[str, Any]:
        path = self._finished(request)
        about = {**read_notes(path), **_about(request)}
        if "name" in request and request["name"] != path.stem:
            path = self._rename(path, request["name"])
        write_notes(path, about)
        return {"name": path.name, **about}

    def _rename(self, path: Path, name: Any) -> Path:
        renamed = recording_path(self._folder, name)
        if renamed.exists():
            raise RequestError(f"{renamed.name} already exists; give another name")
        try:
            path.rename(renamed)
            with suppress(FileNotFoundError):
                path.with_suffix(SUFFIX).replace(renamed.with_suffix(SUFFIX))
        except OSError as error:
            raise RequestError(f"{path.name} cannot be renamed ({error.strerror})") from None
        return renamed

    def _delete(self, request: Request) -> dict[str, Any]:
        path = self._finished(request)
        try:
            path.unlink()
            path.with_suffix(SUFFIX).unlink(missing_ok=True)
        except OSError as error:
            raise RequestError(f"{path.name} cannot be deleted ({error.strerror})") from None
        return {"name": path.name}

    def _finished(self, request: Request) -> Path:
        """The take that a request is about. Raises `RequestError` if it does not exist or is still being recorded."""
        answer, name = self._recorder["recordings"]({}), request.get("recording")
        if not isinstance(name, str) or name not in answer["recordings"]:
            raise RequestError(f"recording is {quoted(name)}; `recordings` lists those in {answer['folder']}")
        if answer["recording"] is not None and answer["recording"]["name"] == name:
            raise RequestError(f"{name} is still being recorded; end it with stop_recording first")
        return self._folder / name


def take_name(slate: str, number: int | None) -> str:
    """The name of a take: its slate, and its number if it has one."""
    return slate if number is None else f"{slate} take {number}"


def read_notes(path: Path) -> dict[str, Any]:
    """What is known about a recording: some of `slate`, `number` and `note`. A damaged file holds nothing."""
    try:
        notes = json.loads(path.with_suffix(SUFFIX).read_text(encoding="utf-8"))
        return _about(notes) if isinstance(notes, dict) else {}
    except (OSError, ValueError, RecursionError):
        return {}


def write_notes(path: Path, about: Mapping[str, Any]) -> None:
    """Write what is known about a recording beside it. Raises `RequestError`."""
    notes = {key: about[key] for key in _KEYS if about.get(key) not in (None, "")}
    try:
        if not notes:
            path.with_suffix(SUFFIX).unlink(missing_ok=True)
            return
        with replacing(path.with_suffix(SUFFIX)) as file:
            file.write(json.dumps(notes, ensure_ascii=False, indent=1).encode("utf-8"))
    except OSError as error:
        raise RequestError(f"the notes of {path.name} cannot be written ({error.strerror})") from None


def _about(request: Request) -> dict[str, Any]:
    """The slate, the number and the note in a request, as far as they are there. Raises `RequestError`."""
    about: dict[str, Any] = {}
    for key, most in (("slate", MAX_SLATE), ("note", MAX_NOTE)):
        if (value := request.get(key)) is not None:
            if not isinstance(value, str) or len(value) > most:
                raise RequestError(f"{key} is {quoted(value)}; it must be a text of at most {most} characters")
            about[key] = value
    if (number := request.get("number")) is not None:
        if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number <= MAX_NUMBER:
            raise RequestError(f"number is {quoted(number)}; allowed are 0 … {MAX_NUMBER}")
        about["number"] = number
    return about
