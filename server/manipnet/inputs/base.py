"""Counts what a receiver receives, logs what is wrong with it, and passes on the good frames."""

import logging
from collections.abc import Callable, Iterable

from manipnet.common.log_limits import LogThrottle
from manipnet.telemetry import Telemetry
from manipnet.wire.bodies import BodyFrame

LOG_PERIOD_S = 1.0
Sink = Callable[[BodyFrame], None]

_log = logging.getLogger(__name__)


class Intake:
    """Passes the frames of one protocol on to `sink`, on the receiver's own thread."""

    def __init__(self, protocol: str, drop_reasons: Iterable[str], sink: Sink, telemetry: Telemetry) -> None:
        self.protocol = protocol
        self.telemetry = telemetry
        self._sink = sink
        self._log_throttle = LogThrottle(LOG_PERIOD_S)
        telemetry.declare("frames_in", protocol)
        telemetry.declare("sender_restarts", protocol)
        telemetry.declare("frames_dropped", *drop_reasons)
        self._count_frame = telemetry.counter("frames_in", source=protocol)

    def accept(self, frame: BodyFrame) -> None:
        """Count a frame and pass it on. A fault of the sink is logged and counted; it does not end the receiver."""
        self._count_frame()
        try:
            self._sink(frame)
        except Exception:
            self.telemetry.count("frames_dropped", reason="internal")
            _log.exception("%s: a frame of %s could not be taken in", self.protocol, frame.source)

    def drop(self, reason: str, source: str, text: object = "", n: int = 1) -> None:
        """Count `n` lost frames or messages, and log at most one line for each reason in a period."""
        self.telemetry.count("frames_dropped", n, reason=reason)
        held_back = self._log_throttle.admit(reason, n)
        if held_back is not None:
            more = f" ({held_back} more since the last line)" if held_back else ""
            _log.warning("%s dropped (%s): %s%s", source, reason, text, more)
