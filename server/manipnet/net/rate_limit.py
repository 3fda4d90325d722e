"""Decides which messages are read when a port is flooded, before any of them is parsed."""

UNKNOWN_PER_S = 500
FAULTS_PER_S = 50
KNOWN_PER_S = 4_000
"""More than 360 frames per second of ten messages each, which no proper sender exceeds."""
MAX_SOURCES = 256


class SourceRateLimiter:
    """Admits the messages of known sources; all unknown sources share one small budget.

    A source is known after its first good message, and unknown again when it sends `FAULTS_PER_S` bad messages within a
    second. So a flood costs one look-up per message and cannot crowd out a stream that works. An unknown source with as
    many bad messages gets nothing more of the budget until the second is over. A known source is not read more than
    `known_per_s` times per second, even if all its messages are good. Reads no clock: the time is an argument.
    """

    def __init__(self, known_per_s: int = KNOWN_PER_S) -> None:
        self._known_per_s = known_per_s
        self._read: dict[object, int] = {}
        self._known: dict[object, None] = {}
        self._faults: dict[object, int] = {}
        self._unknown = 0
        self._window_s = float("-inf")

    def admits(self, source: object, now_s: float) -> bool:
        """Whether a message of `source` (anything hashable) should be read now."""
        if now_s - self._window_s >= 1.0:
            self._window_s = now_s
            self._unknown = 0
            self._faults.clear()
            self._read.clear()
        if source in self._known:
            self._read[source] = self._read.get(source, 0) + 1
            return self._read[source] <= self._known_per_s
        if self._unknown >= UNKNOWN_PER_S or self._faults.get(source, 0) >= FAULTS_PER_S:
            return False
        self._unknown += 1
        return True

    def good(self, source: object) -> None:
        """Note that `source` sent a message that could be used."""
        if source not in self._known:
            if len(self._known) >= MAX_SOURCES:
                del self._known[next(iter(self._known))]
            self._known[source] = None

    def bad(self, source: object) -> None:
        """Note that `source` sent a message that could not be used."""
        if source in self._faults or len(self._faults) < MAX_SOURCES:
            self._faults[source] = self._faults.get(source, 0) + 1
        if self._faults.get(source, 0) >= FAULTS_PER_S:
            self._known.pop(source, None)


class Throttle:
    """Spaces out operations: at most `per_s` per second, after a `burst` that may come at once. Reads no clock."""

    def __init__(self, per_s: float, burst: int) -> None:
        self._period_s, self._credit_s = 1.0 / per_s, burst / per_s
        self._next_s = float("-inf")

    def delay_s(self, now_s: float) -> float:
        """The seconds to wait before the next operation, which counts as done."""
        self._next_s = max(self._next_s, now_s - self._credit_s) + self._period_s
        return max(self._next_s - now_s, 0.0)
