"""Handles internal errors on the tick path: each is counted, recorded and logged, and the ticks go on."""

import logging
import time
from collections.abc import Sequence

from manipnet.actors.actor import Actor
from manipnet.runtime.flight_recorder import FlightRecorder
from manipnet.telemetry import Telemetry
from manipnet.tracking.tick import Tick

_log = logging.getLogger(__name__)


class TickErrors:
    """Takes the errors of one tick loop. Belongs to the tick thread."""

    def __init__(self, actors: Sequence[Actor], recorder: FlightRecorder, telemetry: Telemetry) -> None:
        self._actors, self._recorder, self._telemetry = actors, recorder, telemetry

    def report(self, stage: str, error: Exception, *ticks: Tick) -> None:
        """Count the error of a stage, write what led to it to a file, and let all hands go on from what they show."""
        self._telemetry.count("tick_errors", stage=stage)
        path = self._recorder.dump(error, ticks, time.monotonic())
        where = f"; the frames before it are in {path}" if path else ""
        _log.error("%s failed: %s: %s%s", stage, type(error).__name__, error, where)
        for actor in self._actors:
            actor.recover()
