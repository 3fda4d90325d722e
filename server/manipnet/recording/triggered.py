"""Recordings that other programs begin and end: Motive's remote trigger, and OSC."""

import logging
import queue
import threading
from collections import deque
from typing import Final

from manipnet.control.request import RequestError
from manipnet.recording.open_recording import OpenRecording
from manipnet.recording.recorder import Recorder
from manipnet.recording.take_notes import MAX_NOTE, write_notes
from manipnet.telemetry import Telemetry
from manipnet.wire.record_trigger import RecordTrigger

MAX_WAITING: Final = 16
REMEMBERED: Final = 64
"""Packets of which copies are recognised."""
_log = logging.getLogger(__name__)


class TriggeredRecordings:
    """Begins and ends recordings as triggers say, on a thread of its own. A repeated trigger changes nothing.

    A stop that names a take ends only the recording that was begun under this name. A start ends a recording that
    another trigger has begun, since its stop may have been lost on the way; it never ends one that a person has begun.
    """

    def __init__(self, recorder: Recorder, telemetry: Telemetry) -> None:
        self._recorder, self._telemetry = recorder, telemetry
        self._packets: deque[str] = deque(maxlen=REMEMBERED)
        self._own: OpenRecording | None = None
        self._requested = ""
        """The name under which the recording `_own` was requested."""
        self._waiting: queue.Queue[RecordTrigger | None] = queue.Queue(MAX_WAITING)
        self._thread = threading.Thread(target=self._run, name="record-triggers", daemon=True)
        self._thread.start()

    def __call__(self, trigger: RecordTrigger) -> None:
        """Take a trigger and return at once. From any thread."""
        try:
            self._waiting.put_nowait(trigger)
        except queue.Full:
            self._telemetry.count("triggers_refused", reason="busy")

    def close(self) -> None:
        """Do what waits, and end the thread. The recording in progress goes on. Does nothing the second time."""
        if self._thread.is_alive():
            self._waiting.put(None)
            self._thread.join()

    def _run(self) -> None:
        while (trigger := self._waiting.get()) is not None:
            try:
                self._telemetry.count("record_triggers", fate=self._take(trigger))
            except RequestError as error:
                self._telemetry.count("record_triggers", fate="failed")
                _log.error("%s cannot %s: %s", trigger.source, _what(trigger), error)
            except Exception:
                self._telemetry.count("record_triggers", fate="failed")
                _log.exception("%s: the trigger failed because of a fault in the server", trigger.source)

    def _take(self, trigger: RecordTrigger) -> str:
        """Do what a trigger says; returns its fate, a label of the counter `record_triggers`."""
        if trigger.packet and trigger.packet in self._packets:
            return "repeated"
        self._packets.append(trigger.packet)
        current = self._recorder.current()
        if self._own is not current:
            self._own = None
        return self._start(trigger, current) if trigger.starts else self._stop(trigger, current)

    def _start(self, trigger: RecordTrigger, current: OpenRecording | None) -> str:
        if current is not None and self._own is None:
            _log.warning(
                "%s wants to %s, but %s is being recorded already and goes on",
                *(trigger.source, _what(trigger), current.path.name),
            )
            return "ignored"
        if current is not None:
            if trigger.name == self._requested:
                return "repeated"
            self._recorder.finish()
        about = {**trigger.about, **({"take": trigger.name} if trigger.name else {}), "trigger": trigger.source}
        path = self._recorder.begin(trigger.name, about)
        self._own, self._requested = self._recorder.current(), trigger.name
        if note := trigger.about.get("notes"):
            write_notes(path, {"note": note[:MAX_NOTE]})
        _log.info("%s has begun the recording %s", trigger.source, path.name)
        return "started"

    def _stop(self, trigger: RecordTrigger, current: OpenRecording | None) -> str:
        if current is None:
            return "repeated"
        if trigger.name and (self._own is None or trigger.name != self._requested):
            _log.warning(
                "%s wants to %s, but it is %s that is being recorded, so it goes on",
                *(trigger.source, _what(trigger), current.path.name),
            )
            return "ignored"
        self._own = None
        self._recorder.finish()
        return "stopped"


def _what(trigger: RecordTrigger) -> str:
    name = f" {trigger.name[:64]!r}" if trigger.name else ""
    return f"{'begin' if trigger.starts else 'end'} a recording{name}"
