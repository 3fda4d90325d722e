"""What is counted while a session runs: counters with closed label sets, safe to add to from any thread."""

import threading
from collections import Counter

SOURCES = ("zmq", "osc", "natnet")
DROP_REASONS = (
    "malformed",  # not a message of the protocol, or one that breaks its rules
    "oversized",  # larger than any message may be
    "not_allowed",  # a sender that is on no allow-list
    "rate",  # a source that sends garbage faster than it is worth reading
    "kernel",  # lost in the socket's buffer before it was read
    "unsupported",  # a version or message kind that is not understood
    "duplicate",  # the same instant twice
    "late",  # older than what was already accepted
)
BODY_REASONS = (
    "nan",
    "bounds",
    "zero_quaternion",
    "frozen",  # tracked, but bit-identical for too long
    "jump",  # farther from the last sample than a body can move: an identity swap
)

LABELS: dict[str, tuple[str, tuple[str, ...]]] = {
    "frames_in": ("source", SOURCES),
    "frames_dropped": ("reason", DROP_REASONS),
    "bodies_rejected": ("reason", BODY_REASONS),
    "sender_restarts": ("source", SOURCES),
}
"""Every counter with its one label and the values that label may take."""


class Counters:
    """Rising counters: `add("frames_dropped", reason="late")`. An unknown name or label is a `KeyError`."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._values: Counter[tuple[str, str]] = Counter()

    def add(self, name: str, n: int = 1, **label: str) -> None:
        key, allowed = LABELS[name]
        value = label[key]
        if value not in allowed:
            raise KeyError(f"{name}: {key} {value!r} is none of {', '.join(allowed)}")
        with self._lock:
            self._values[name, value] += n

    def snapshot(self) -> dict[str, dict[str, int]]:
        """`{name: {label value: count}}`, only what was counted at least once."""
        with self._lock:
            values = dict(self._values)
        result: dict[str, dict[str, int]] = {}
        for (name, value), count in sorted(values.items()):
            result.setdefault(name, {})[value] = count
        return result
