"""What one session counts and measures: one `Telemetry` object, which is passed to everything that reports something.

Every counter has one label. The counters are declared here, with the values that their labels may take; the protocols
add theirs with `Telemetry.declare` when they open. The sets are closed from then on, so a sender cannot make them grow.
"""

import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from typing import Any, Final

import numpy as np

from manipnet.common.durations import Durations

DROP_REASONS = (
    "duplicate",  # the same instant twice
    "internal",  # a fault of the server while it took the frame in
    "late",  # older than what was already accepted
    "unknown_body",  # the rig knows none of its bodies
    "other_sender",  # a second sender of the same bodies while the first one still sends
    "time_jump",  # far from the stream's time, and no other frames near it
    "mailbox_full",  # the tick loop could not keep up
)
"""Why frames of any protocol are dropped once they have arrived; `Input.drop_reasons` are the protocols' own."""
BODY_REASONS = (
    "nan",
    "bounds",
    "zero_quaternion",
    "conflict",  # two bodies have the same id or name
    "frozen",  # tracked, but bit-identical for too long
    "jump",  # farther from the last sample than a body can move
    "swap",  # two bodies in each other's place from one frame to the next
    "zeros",  # at exactly the origin, far from where it was: a relay's way to say lost
)

CONTROL_OPS = (
    *("hello", "ping", "status", "objects", "mesh", "select_object", "add_object", "place_object", "calibrate"),
    *("hand_profile", "look_ahead", "rest", "pause", "record", "stop_recording", "recordings", "edit_recording"),
    *("delete_recording", "save_rig", "invalid"),
)

LABELS: dict[str, tuple[str, tuple[str, ...]]] = {
    "frames_in": ("source", ()),
    "frames_dropped": ("reason", DROP_REASONS),
    "bodies_rejected": ("reason", BODY_REASONS),
    "sender_restarts": ("source", ()),
    "receiver_restarts": ("source", ()),
    "connections_refused": ("reason", ("handshake", "socket_type", "not_listed", "too_many", "endless", "token")),
    "hand_ticks": ("state", ("live", "hold", "rest")),
    "ticks_skipped": ("reason", ("backlog", "restart")),
    "tick_errors": ("stage", ("input", "plan", "synthesis", "show", "publish", "avatar")),
    "output_guarded": ("reason", ("not_finite", "limit", "speed")),
    "messages_out": ("topic", ()),
    "control_requests": ("op", CONTROL_OPS),
    "recorded": ("fate", ("written", "lost")),
    "record_triggers": ("fate", ("started", "stopped", "repeated", "ignored", "failed")),
    "triggers_refused": ("reason", ("malformed", "oversized", "doctype", "not_allowed", "rate", "busy")),
    "page_frames": ("fate", ("shown", "skipped")),
    "page_ended": ("reason", ("crash",)),
}
"""Every counter with its one label and the values of it that are known without the protocols."""


LOSSES: Final = ("frames_dropped", "bodies_rejected", "connections_refused")
"""The counters of what is lost or refused, of which `losses` tells how often it happens at present."""

STAGES: Final = ("sense", "infer", "ik", "encode", "total", "interval")
"""The durations that `Timings` records, in seconds. `total` runs from the arrival of the packet that a tick waited for
until the tick's message is sent.
"""

Gauge = tuple[str, str, Mapping[str, float]]
"""A measurement of this moment: its name, the name of its label, and the level by each of the few label values."""
GaugeSource = Callable[[], Iterable[Gauge]]


class Telemetry:
    """Counters, durations and gauges of one session. Thread-safe, except `stages`, which belongs to the tick thread."""

    def __init__(self) -> None:
        self.timings = Timings()
        self.stages = StageClock(self.timings)
        self._lock = threading.Lock()
        self._labels = dict(LABELS)
        self._counts: Counter[tuple[str, str]] = Counter()
        self._recent: dict[tuple[str, str], Recent] = {}
        self._gauges: list[GaugeSource] = []
        self._receivers: dict[str, Callable[[], Mapping[str, Any]]] = {}

    def count(self, name: str, n: int = 1, **label: str) -> None:
        """Raise a counter by `n`: `count("frames_dropped", reason="late")`.

        Raises `KeyError` for a counter or a label value that is not declared.
        """
        self._add(self._key(name, label), n)

    def counter(self, name: str, **label: str) -> Callable[[], None]:
        """A function that raises a counter by one, for what is counted so often that its label is checked only once.

        Raises `KeyError` as `count` does.
        """
        return partial(self._add, self._key(name, label), 1)

    def _key(self, name: str, label: Mapping[str, str]) -> tuple[str, str]:
        key, allowed = self._labels[name]
        value = label[key]
        if value not in allowed:
            raise KeyError(f"{name}: {key} {value!r} is not declared; allowed are {', '.join(allowed)}")
        return name, value

    def _add(self, key: tuple[str, str], n: int) -> None:
        with self._lock:
            self._counts[key] += n
            if key[0] in LOSSES:
                self._recent.setdefault(key, Recent()).note(n, time.monotonic())

    def declare(self, name: str, *values: str) -> None:
        """Let the label of the counter `name` take these values too."""
        with self._lock:
            label, known = self._labels[name]
            self._labels[name] = label, tuple(dict.fromkeys((*known, *values)))

    def labels(self) -> dict[str, tuple[str, tuple[str, ...]]]:
        """Every counter with its one label and the values that the label may take."""
        with self._lock:
            return dict(self._labels)

    def counts(self) -> dict[str, dict[str, int]]:
        """`{name: {label value: count}}` of everything that was counted at least once."""
        with self._lock:
            counts = dict(self._counts)
        result: dict[str, dict[str, int]] = {}
        for (name, value), count in sorted(counts.items()):
            result.setdefault(name, {})[value] = count
        return result

    def losses(self) -> dict[str, dict[str, dict[str, float]]]:
        """For each counter in `LOSSES` and each label value: the `count`, the present `rate_hz`, and the `age_s`."""
        now_s = time.monotonic()
        result: dict[str, dict[str, dict[str, float]]] = {}
        with self._lock:
            for (name, value), recent in sorted(self._recent.items()):
                count = self._counts[name, value]
                result.setdefault(name, {})[value] = {"count": count} | recent.report(now_s)
        return result

    def add_gauges(self, source: GaugeSource) -> None:
        """Let `gauges` include what `source` measures; it is called on the thread that reads the gauges."""
        self._gauges.append(source)

    def gauges(self) -> Iterator[Gauge]:
        """Everything that is measured at this moment."""
        for source in tuple(self._gauges):
            yield from source()

    def add_receiver(self, name: str, report: Callable[[], Mapping[str, Any]]) -> None:
        """Let `receivers` include what `report` returns of the socket `name`."""
        with self._lock:
            self._receivers[name] = report

    def receivers(self) -> dict[str, Mapping[str, Any]]:
        """By name, whether each socket listens: `state` ("listening" or "down"), `restarts` and `error`."""
        with self._lock:
            receivers = dict(self._receivers)
        return {name: report() for name, report in receivers.items()}


class Recent:
    """How often something happens at present, and when it happened for the last time."""

    PERIOD_S: Final = 2.0

    def __init__(self) -> None:
        self._since_s = self._newest_s = float("-inf")
        self._count, self._before_hz = 0, 0.0

    def note(self, n: int, now_s: float) -> None:
        """It has happened `n` times."""
        if now_s - self._since_s >= self.PERIOD_S:
            passed_s = now_s - self._since_s
            self._before_hz = self._count / passed_s if passed_s < 2.0 * self.PERIOD_S else 0.0
            self._since_s, self._count = now_s, 0
        self._newest_s = now_s
        self._count += n

    def report(self, now_s: float) -> dict[str, float]:
        """`rate_hz` and `age_s`."""
        passed_s = now_s - self._since_s
        age_s = max(now_s - self._newest_s, 0.0)
        rate_hz = self._count / passed_s if passed_s > 0.25 * self.PERIOD_S else self._before_hz or self._count
        return {"rate_hz": rate_hz if age_s <= self.PERIOD_S else 0.0, "age_s": age_s}


class Timings:
    """Durations by stage: statistics since the start, and the newest `window` durations for the line of each second."""

    def __init__(self, window: int = 960) -> None:
        self._lock = threading.Lock()
        self._all = {stage: Durations() for stage in STAGES}
        self._recent = {stage: deque[float](maxlen=window) for stage in STAGES}

    def record(self, stage: str, seconds: float) -> None:
        """Add one duration."""
        with self._lock:
            self._all[stage].add(seconds)
            self._recent[stage].append(seconds)

    def recent(self, stage: str, *percentiles: float) -> list[float]:
        """Percentiles, in seconds, of the durations since the last call, or zeros if there are none."""
        with self._lock:
            values = list(self._recent[stage])
            self._recent[stage].clear()
        return [float(v) for v in np.percentile(values, percentiles)] if values else [0.0] * len(percentiles)

    def overall(self, stage: str, *percentiles: float) -> list[float]:
        """Percentiles, in seconds, of all durations since the start."""
        with self._lock:
            return [self._all[stage].percentile(p) for p in percentiles]

    def totals(self, stage: str) -> tuple[int, float]:
        """The number of durations since the start, and their sum in seconds."""
        with self._lock:
            return self._all[stage].count, self._all[stage].sum_s


class StageClock:
    """Measures the stages of a tick, which follow one another. Belongs to the tick thread."""

    def __init__(self, timings: Timings) -> None:
        self._timings = timings
        self._since_s = 0.0
        self.last_ms: dict[str, float] = {}
        """The stages of the newest tick, in milliseconds."""

    def begin(self) -> None:
        """The first stage of a tick begins."""
        self.last_ms, self._since_s = {}, time.monotonic()

    def ended(self, stage: str) -> None:
        """The stage `stage` has ended, and the next one begins."""
        now_s = time.monotonic()
        self._timings.record(stage, now_s - self._since_s)
        self.last_ms[stage] = 1e3 * (now_s - self._since_s)
        self._since_s = now_s
