"""What every receiver does with what it hears: count it, log faults at a limited rate, pass on the good."""

import logging
from collections.abc import Callable

from manipnet.telemetry import LogThrottle, Telemetry
from manipnet.wire.bodies import BodyFrame

LOG_PERIOD_S = 1.0
Sink = Callable[[BodyFrame], None]

_log = logging.getLogger(__name__)


class Intake:
    """Delivers frames of one protocol to `sink`, which is called in the receiver's own thread."""

    def __init__(self, protocol: str, sink: Sink, telemetry: Telemetry) -> None:
        self.protocol = protocol
        self._sink = sink
        self._telemetry = telemetry
        self._log_throttle = LogThrottle(LOG_PERIOD_S)

    def accept(self, frame: BodyFrame) -> None:
        self._telemetry.count("frames_in", source=self.protocol)
        try:
            self._sink(frame)
        except Exception:  # the receive thread outlives a bug behind it; the bug is counted and shown
            self._telemetry.count("frames_dropped", reason="internal")
            _log.exception("%s: a frame of %s was not digested", self.protocol, frame.source)

    def drop(self, reason: str, source: str, text: object = "", n: int = 1) -> None:
        """Count `n` lost frames and log one line of them per reason and period."""
        self._telemetry.count("frames_dropped", n, reason=reason)
        held_back = self._log_throttle.admit(reason, n)
        if held_back is not None:
            more = f" ({held_back} more since the last line)" if held_back else ""
            _log.warning("%s dropped (%s): %s%s", source, reason, text, more)
