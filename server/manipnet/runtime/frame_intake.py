"""From a received frame to the actors: poses that cannot be real are taken out, and every lost frame is counted."""

import logging
from collections.abc import Mapping, Sequence
from typing import Final

from manipnet.actors.actor import Actor
from manipnet.config.settings import BodyKey
from manipnet.runtime.flight_recorder import FlightRecorder
from manipnet.runtime.tick_errors import TickErrors
from manipnet.telemetry import Telemetry
from manipnet.tracking.outlier_gate import OutlierGate
from manipnet.wire.bodies import BodyFrame, BodySample

_USED = ""
_BEST_FIRST: Final = (_USED, "duplicate", "other_sender", "late", "time_jump", "internal", "unknown_body")
"""Outcomes of a frame. Of the outcomes at several actors, the first in this order counts."""

MOST_SENDERS: Final = 64
_log = logging.getLogger(__name__)


class FrameIntake:
    """Gives every frame to all actors. Belongs to the tick thread."""

    def __init__(
        self, actors: Sequence[Actor], recorder: FlightRecorder, errors: TickErrors, telemetry: Telemetry
    ) -> None:
        self._actors, self._recorder, self._errors, self._telemetry = actors, recorder, errors, telemetry
        self._gate = OutlierGate()
        self._useful: set[str] = set()
        """Senders of which a frame was used; the others are reported when none of their bodies is in the rig."""

    def push(self, frame: BodyFrame) -> None:
        """Take a frame as it was received."""
        self._recorder.note(frame)
        frame, faults = self._gate.check(frame)
        for fault in faults:
            self._telemetry.count("bodies_rejected", reason=fault)
        bodies = frame.by_key()
        outcome = min([self._push(actor, frame, bodies) for actor in self._actors], key=_BEST_FIRST.index)
        if outcome == _USED:
            self._note_useful(frame.source)
            return
        self._telemetry.count("frames_dropped", reason=outcome)
        if outcome == "unknown_body" and frame.source not in self._useful:
            _log.warning("a frame from %s has no body of the rig: %s", frame.source, self._compare(frame))

    def _note_useful(self, source: str) -> None:
        if source not in self._useful:
            if len(self._useful) >= MOST_SENDERS:
                self._useful.clear()
            self._useful.add(source)

    def _push(self, actor: Actor, frame: BodyFrame, bodies: Mapping[BodyKey, BodySample]) -> str:
        try:
            return actor.push(frame, bodies) or _USED
        except Exception as error:
            self._errors.report("input", error)
            return "internal"

    def _compare(self, frame: BodyFrame) -> str:
        """The bodies that arrived and those that are expected, for the person who has to make them match."""
        received = [str(body.id if body.name is None else body.name) for body in frame.bodies]
        expected = [str(key) for actor in self._actors for key in actor.expected()]
        return f"it has {', '.join(received[:8]) or 'no bodies'}; the rig expects {', '.join(expected[:16])}"
