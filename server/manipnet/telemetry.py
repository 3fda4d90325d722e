"""What is counted and timed while a session runs, and the log that cannot be flooded.

Every counter and the values of its label are declared here: the sets are closed, so no sender can make them
grow.
"""

import logging
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from typing import Final

import numpy as np
from hdrh.histogram import HdrHistogram

SOURCES = ("zmq", "osc", "natnet")
DROP_REASONS = (
    "malformed",  # not a message of the protocol, or one that breaks its rules
    "oversized",  # larger than any message may be
    "not_allowed",  # a sender that is on no allow-list
    "rate",  # a source that sends garbage faster than it is worth reading
    "kernel",  # lost in the socket's buffer before it was read
    "unsupported",  # a version or message kind that is not understood
    "incomplete",  # a part of the frame did not arrive
    "duplicate",  # the same instant twice
    "internal",  # a fault of our own while a frame was taken in
    "late",  # older than what was already accepted
    "unknown_body",  # nothing in it that the rig knows
    "other_sender",  # a second sender of the same bodies while the first one is heard
    "time_jump",  # far from the stream's time, and no others with it
    "mailbox_full",  # the tick loop could not keep up
)
BODY_REASONS = (
    "nan",
    "bounds",
    "zero_quaternion",
    "frozen",  # tracked, but bit-identical for too long
    "jump",  # farther from the last sample than a body can move
    "swap",  # two bodies in each other's place from one frame to the next
    "zeros",  # at exactly the origin, far from where it was: a relay's way to say lost
)

CONTROL_OPS = (
    *("hello", "ping", "status", "objects", "mesh", "select_object", "add_object", "place_object", "calibrate"),
    *("look_ahead", "rest", "pause", "record", "stop_recording", "recordings", "invalid"),
)

LABELS: dict[str, tuple[str, tuple[str, ...]]] = {
    "frames_in": ("source", SOURCES),
    "frames_dropped": ("reason", DROP_REASONS),
    "bodies_rejected": ("reason", BODY_REASONS),
    "sender_restarts": ("source", SOURCES),
    "connections_refused": ("reason", ("handshake", "not_listed", "too_many", "endless")),
    "hand_ticks": ("state", ("live", "hold", "rest")),
    "ticks_skipped": ("reason", ("backlog", "restart")),
    "tick_errors": ("stage", ("input", "plan", "synthesis", "show", "publish")),
    "output_guarded": ("reason", ("not_finite", "limit", "speed")),
    "messages_out": ("topic", ("msgpack", "bin", "vmc", "livelink", "web")),
    "control_requests": ("op", CONTROL_OPS),
    "recorded": ("fate", ("written", "lost")),
    "page_frames": ("fate", ("shown", "skipped")),
    "page_ended": ("reason", ("crash",)),
}
"""Every counter with its one label and the values that label may take."""


STAGES: Final = ("sense", "infer", "ik", "encode", "total", "interval")
"""What `Timings` records, seconds; `total` runs from the packet a tick waited for to its message sent."""


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


class Timings:
    """Durations per stage: all since the start, and the newest `window` of them for the second's line."""

    def __init__(self, window: int = 960) -> None:
        self._lock = threading.Lock()
        self._all = {stage: HdrHistogram(1, 60_000_000, 3) for stage in STAGES}
        self._sums_s: dict[str, float] = dict.fromkeys(STAGES, 0.0)
        self._recent = {stage: deque[float](maxlen=window) for stage in STAGES}

    def record(self, stage: str, seconds: float) -> None:
        """Add one duration; microsecond resolution, 1 µs to 60 s."""
        with self._lock:
            self._all[stage].record_value(min(max(int(seconds * 1e6), 1), 60_000_000))
            self._recent[stage].append(seconds)
            self._sums_s[stage] += seconds

    def recent(self, stage: str, *percentiles: float) -> list[float]:
        """Percentiles of the newest durations in seconds, emptied by reading; zeros when there are none."""
        with self._lock:
            values = list(self._recent[stage])
            self._recent[stage].clear()
        return [float(v) for v in np.percentile(values, percentiles)] if values else [0.0] * len(percentiles)

    def overall(self, stage: str, *percentiles: float) -> list[float]:
        """Percentiles since the start, seconds."""
        with self._lock:
            return [self._all[stage].get_value_at_percentile(p) * 1e-6 for p in percentiles]

    def totals(self, stage: str) -> tuple[int, float]:
        """How many durations were recorded since the start, and their sum in seconds."""
        with self._lock:
            return int(self._all[stage].get_total_count()), self._sums_s[stage]


class StageClock:
    """Times the stages of one tick as they end, one after another. Belongs to the tick thread."""

    def __init__(self, timings: Timings) -> None:
        self._timings = timings
        self._since_s = 0.0
        self.last_ms: dict[str, float] = {}
        """The stages of the newest tick, milliseconds."""

    def begin(self) -> None:
        """A tick begins."""
        self.last_ms, self._since_s = {}, time.monotonic()

    def ended(self, stage: str) -> None:
        """A stage has ended, and the next begins."""
        now_s = time.monotonic()
        self._timings.record(stage, now_s - self._since_s)
        self.last_ms[stage] = 1e3 * (now_s - self._since_s)
        self._since_s = now_s


class RateLimit(logging.Filter):
    """Lets each message template through once per `interval_s`; the next one says how many it stands for."""

    def __init__(self, clock: Callable[[], float], interval_s: float = 5.0) -> None:
        super().__init__()
        self._clock, self._interval_s = clock, interval_s
        self._last: dict[str, tuple[float, int]] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        if record.levelno < logging.WARNING:
            return True
        # Templates are literals of our code, so this map stays small whatever arrives.
        now, key = self._clock(), f"{record.name}:{record.msg}"
        shown_at, held_back = self._last.get(key, (float("-inf"), 0))
        if now - shown_at < self._interval_s:
            self._last[key] = (shown_at, held_back + 1)
            return False
        self._last[key] = (now, 0)
        record.event = record.msg
        if held_back:
            record.msg = f"{record.msg} (and {held_back} more like it)"
        return True
