"""Statistics of each sender of bodies: its rate, the age of its newest frame, and the offset of its clock.

One-way traffic gives the clock offset only up to the transit time, so the frame with the shortest transit counts. That
transit time is unknown, so the offset has no uncertainty, unlike that of a ping exchange.
"""

import threading
from dataclasses import dataclass, field
from typing import Any

from manipnet.inputs.base import Sink
from manipnet.wire.bodies import MAX_BODIES, BodyFrame

MOST = 64
MOST_WAITING = 32
"""Frames whose bodies are counted together."""
RATE_S = 1.0
CLOCK_S = 10.0
"""The fastest frame of the last one to two of these periods counts, since clocks drift."""
RESTART_S = 1.0
"""Transit times vary by less than this. A larger change means that the sender's clock was set or restarted."""


_Key = tuple[int | None, str | None]
"""Id and name of a body."""


@dataclass(slots=True)
class _Pace:
    """How fast the clock of a sender runs: where the current period began, and the speed in the period before."""

    since_s: float
    since_t_s: float
    speed: float | None = None

    def note(self, t_s: float, now_s: float) -> None:
        if now_s - self.since_s >= RATE_S:
            self.speed = (t_s - self.since_t_s) / (now_s - self.since_s)
            self.since_s, self.since_t_s = now_s, t_s


class _Body:
    """How often one body of a sender arrives, and how often it is tracked, in the current period and the one before."""

    __slots__ = ("counted", "heard_s", "rate_hz", "share", "since_s", "tracked")

    def __init__(self, now_s: float) -> None:
        self.since_s = self.heard_s = now_s
        self.counted = self.tracked = 0
        self.rate_hz, self.share = 0.0, 0.0

    def turn(self, now_s: float) -> None:
        """End a period with the arrival of a frame that is not counted yet."""
        self.rate_hz, self.share = self.counted / (now_s - self.since_s), self.tracked / self.counted
        self.since_s, self.counted, self.tracked = now_s, 0, 0

    def report(self, id: int | None, name: str | None, now_s: float) -> dict[str, Any]:
        """`id`, `name`, `rate_hz`, `age_s` and the share of the frames in which it was `tracked`."""
        is_young = not self.rate_hz
        return {
            "id": id,
            "name": name,
            "rate_hz": self._rate_so_far() if is_young else self.rate_hz,
            "age_s": max(now_s - self.heard_s, 0.0),
            "tracked": self.tracked / self.counted if self.counted and is_young else self.share,
        }

    def _rate_so_far(self) -> float:
        passed_s = self.heard_s - self.since_s
        return (self.counted - 1) / passed_s if passed_s > 0.0 else 0.0


@dataclass(slots=True)
class _Sender:
    frames: int
    heard_s: float
    rated_s: float
    counted: int
    rate_hz: float
    clocked_s: float
    offset_s: float
    offset_before_s: float
    pace: _Pace
    bodies: dict[_Key, _Body] = field(default_factory=dict)
    waiting: list[BodyFrame] = field(default_factory=list)
    """The newest frames, whose bodies are not counted yet."""


class SenderStats:
    """Notes every frame and passes it on to `sink`. From any thread."""

    def __init__(self, sink: Sink) -> None:
        self._sink = sink
        self._lock = threading.Lock()
        self._senders: dict[str, _Sender] = {}

    def __call__(self, frame: BodyFrame) -> None:
        with self._lock:
            self._note(frame, frame.t_received_s, frame.t_s - frame.t_received_s)
        self._sink(frame)

    def report(self, now_s: float) -> dict[str, dict[str, Any]]:
        """For each source: frames so far, frames per second, age of the newest frame, offset of its clock from ours.

        `clock_speed` is how many seconds of its clock pass in one of ours, or None in its first second. `bodies` are
        its bodies, each with its rate, its age and the share of the frames in which it is tracked.
        """
        with self._lock:
            for sender in self._senders.values():
                _digest(sender)
            return {
                source: {
                    "frames": sender.frames,
                    "rate_hz": sender.rate_hz if now_s - sender.heard_s < 2.0 * RATE_S else 0.0,
                    "age_s": max(now_s - sender.heard_s, 0.0),
                    "clock_offset_s": max(sender.offset_s, sender.offset_before_s),
                    "clock_uncertainty_s": None,
                    "clock_speed": sender.pace.speed,
                    "bodies": [body.report(*key, now_s) for key, body in sender.bodies.items()],
                }
                for source, sender in self._senders.items()
            }

    def _note(self, frame: BodyFrame, now_s: float, offset_s: float) -> None:
        sender = self._senders.pop(frame.source, None)
        if sender is None or abs(offset_s - sender.offset_s) > RESTART_S:
            if sender is None:
                sender = _Sender(0, now_s, now_s, 0, 0.0, now_s, offset_s, offset_s, _Pace(now_s, frame.t_s))
            else:  # its clock was set or has restarted
                sender.clocked_s, sender.offset_s, sender.offset_before_s = now_s, offset_s, offset_s
        if len(self._senders) >= MOST:
            del self._senders[next(iter(self._senders))]  # the sender that has been silent for longest
        self._senders[frame.source] = sender
        sender.waiting.append(frame)
        if len(sender.waiting) >= MOST_WAITING:
            _digest(sender)
        sender.frames += 1
        sender.heard_s = now_s
        sender.pace.note(frame.t_s, now_s)
        sender.counted += 1
        if now_s - sender.rated_s >= RATE_S:
            sender.rate_hz = (sender.counted - 1) / (now_s - sender.rated_s)
            sender.rated_s, sender.counted = now_s, 1
        if now_s - sender.clocked_s >= CLOCK_S:
            sender.clocked_s, sender.offset_before_s, sender.offset_s = now_s, sender.offset_s, offset_s
        sender.offset_s = max(sender.offset_s, offset_s)


def _digest(sender: _Sender) -> None:
    """Count the bodies of the frames that wait. Most have the same bodies as the one before."""
    keys: list[_Key] = []
    group: list[BodyFrame] = []
    for frame in sender.waiting:
        own = [(sample.id, sample.name) for sample in frame.bodies]
        if group and own != keys:
            _count(sender.bodies, keys, group)
            group = []
        keys = own
        group.append(frame)
    if group:
        _count(sender.bodies, keys, group)
    sender.waiting = []


def _count(bodies: dict[_Key, _Body], keys: list[_Key], group: list[BodyFrame]) -> None:
    """Count frames that all have the bodies `keys`, in this order."""
    first_s, newest_s = group[0].t_received_s, group[-1].t_received_s
    for i, key in enumerate(keys):
        body = bodies.get(key)
        if body is None:
            if len(bodies) >= MAX_BODIES:
                del bodies[min(bodies, key=lambda each: bodies[each].heard_s)]
            body = bodies[key] = _Body(first_s)
        elif first_s - body.since_s >= RATE_S and body.counted:
            body.turn(first_s)
        body.heard_s = newest_s
        body.counted += len(group)
        body.tracked += sum([frame.bodies[i].tracked for frame in group])
