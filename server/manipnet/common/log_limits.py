"""Limits how often a log says the same."""

import logging
import threading
import time
from collections.abc import Callable


class LogThrottle:
    """Lets one log line per key pass in each interval and counts the lines that it holds back. Thread-safe."""

    def __init__(self, interval_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._interval_s, self._clock = interval_s, clock
        self._lock = threading.Lock()
        self._shown: dict[str, tuple[float, int]] = {}

    def admit(self, key: str, n: int = 1) -> int | None:
        """How many lines of this key were held back since the last one, if a line may be logged now; else None.

        A line that may not be logged counts as `n` lines.
        """
        now_s = self._clock()
        with self._lock:
            shown_s, held_back = self._shown.get(key, (float("-inf"), 0))
            if now_s - shown_s < self._interval_s:
                self._shown[key] = (shown_s, held_back + n)
                return None
            self._shown[key] = (now_s, 0)
            return held_back


class RepeatFilter(logging.Filter):
    """Lets each message template pass once per `interval_s`; the next line says how many more there were."""

    def __init__(self, clock: Callable[[], float] = time.monotonic, interval_s: float = 5.0) -> None:
        super().__init__()
        self._throttle = LogThrottle(interval_s, clock)

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether a record may pass; those below WARNING always do."""
        if record.levelno < logging.WARNING:
            return True
        # The templates are literals in the source, so the number of keys stays small whatever arrives.
        held_back = self._throttle.admit(f"{record.name}:{record.msg}")
        if held_back is None:
            return False
        record.event = record.msg
        if held_back:
            record.msg = f"{record.msg} (and {held_back} more like it)"
        return True
