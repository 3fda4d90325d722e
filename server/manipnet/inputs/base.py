"""What every receiver does with what it hears: count it, log faults at a limited rate, pass on the good."""

import logging
import threading
import time
from collections.abc import Callable

from manipnet.telemetry import Counters
from manipnet.wire.bodies import BodyFrame

LOG_PERIOD_S = 1.0
Sink = Callable[[BodyFrame], None]

_log = logging.getLogger(__name__)


class Intake:
    """Delivers frames of one protocol to `sink`, which is called in the receiver's own thread."""

    def __init__(self, protocol: str, sink: Sink, counters: Counters) -> None:
        self.protocol = protocol
        self._sink = sink
        self._counters = counters
        self._lock = threading.Lock()
        self._quiet: dict[str, tuple[float, int]] = {}

    def accept(self, frame: BodyFrame) -> None:
        self._counters.add("frames_in", source=self.protocol)
        try:
            self._sink(frame)
        except Exception:  # the receive thread outlives a bug behind it; the bug is counted and shown
            self._counters.add("frames_dropped", reason="internal")
            _log.exception("%s: a frame of %s was not digested", self.protocol, frame.source)

    def drop(self, reason: str, source: str, text: object = "", n: int = 1) -> None:
        """Count `n` lost frames and log one line of them per reason and period."""
        self._counters.add("frames_dropped", n, reason=reason)
        now_s = time.monotonic()
        with self._lock:
            since_s, silent = self._quiet.get(reason, (-LOG_PERIOD_S, 0))
            if now_s - since_s < LOG_PERIOD_S:
                self._quiet[reason] = (since_s, silent + n)
                return
            self._quiet[reason] = (now_s, 0)
        more = f" ({silent} more since the last line)" if silent else ""
        _log.warning("%s dropped (%s): %s%s", source, reason, text, more)
