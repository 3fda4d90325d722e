"""Which messages are worth reading when somebody floods a port: decided before a byte of them is parsed."""

STRANGERS_PER_S = 500
FAULTS_PER_S = 50
KNOWN_PER_S = 4_000
"""More than 360 frames a second in ten pieces each: no sender that is well sends so much."""
MAX_SOURCES = 256


class SourceRateLimiter:
    """Admits a source that is known for good messages; strangers share one small budget.

    A source is known after its first good message and forgotten when it sends more than `FAULTS_PER_S` bad
    ones within a second, so a flood costs one look-up a message and cannot crowd out a stream that works. A
    stranger with as many faults gets no more of the strangers' budget until the second is over. Nor is a known
    source read more than `known_per_s` times a second, however good its messages. Pure: the clock is an argument.
    """

    def __init__(self, known_per_s: int = KNOWN_PER_S) -> None:
        self._known_per_s = known_per_s
        self._read: dict[object, int] = {}
        self._known: dict[object, None] = {}
        self._faults: dict[object, int] = {}
        self._strangers = 0
        self._window_s = float("-inf")

    def admits(self, source: object, now_s: float) -> bool:
        """Whether a message of `source` (anything hashable) should be read now."""
        if now_s - self._window_s >= 1.0:
            self._window_s = now_s
            self._strangers = 0
            self._faults.clear()
            self._read.clear()
        if source in self._known:
            self._read[source] = self._read.get(source, 0) + 1
            return self._read[source] <= self._known_per_s
        if self._strangers >= STRANGERS_PER_S or self._faults.get(source, 0) >= FAULTS_PER_S:
            return False
        self._strangers += 1
        return True

    def good(self, source: object) -> None:
        """`source` sent a message that could be used."""
        if source not in self._known:
            if len(self._known) >= MAX_SOURCES:
                del self._known[next(iter(self._known))]
            self._known[source] = None

    def bad(self, source: object) -> None:
        """`source` sent a message that could not."""
        if source in self._faults or len(self._faults) < MAX_SOURCES:
            self._faults[source] = self._faults.get(source, 0) + 1
        if self._faults.get(source, 0) >= FAULTS_PER_S:
            self._known.pop(source, None)


class Throttle:
    """How long to wait so that no more than `per_s` things are done in a second, after a first `burst`. Pure."""

    def __init__(self, per_s: float, burst: int) -> None:
        self._period_s, self._credit_s = 1.0 / per_s, burst / per_s
        self._next_s = float("-inf")

    def delay_s(self, now_s: float) -> float:
        """Seconds to wait before the next thing, which is counted as done."""
        self._next_s = max(self._next_s, now_s - self._credit_s) + self._period_s
        return max(self._next_s - now_s, 0.0)
